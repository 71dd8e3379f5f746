// Measures `render2mpeg serve` in a headless browser: latency of keys, pictures a second, idle cost, and lines of several rates.
//
//     node bench/serve.mjs RENDER2MPEG SCENE.glb [keys|rest|lines|walk|screens] [OPTIONS OF serve]
//
// keys     time from a key event to the first picture that contains it, and pictures a second while the camera turns
// rest     time until the last picture at rest, and CPU time of the server in 2 s of idleness
// lines    ten minutes behind a line of 4 Mbit/s, 1 Mbit/s and 300 kbit/s in turn: serve-lines.json and .svg
// walk     longest pause, darkest picture and pictures without change while the camera walks, and pictures of the page
// screens  pictures of the page at rest
// Pictures of the page are at 1280 and 390 pixels. Files are written to the current folder.
// MODULES is the folder of the package playwright-core (default: node_modules), CHROMIUM the browser. SECONDS limits the
// presses of `keys` (default: 90), and is the duration of each line of `lines` (default: 200).
import { existsSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { resolve } from "node:path";
import { cpuSeconds, idle, mean, memory, open, pause, proxy, quantile, rest, serve, sway, take } from "./serve_browser.mjs";
import { plot } from "./serve_plot.mjs";

const [program, scene, what = "keys", ...options] = process.argv.slice(2);
const modules = resolve(process.env.MODULES ?? "node_modules");
const browserPath = process.env.CHROMIUM ?? "/usr/bin/chromium";
const seconds = (usual) => Number(process.env.SECONDS ?? usual);
if (!scene || !existsSync(`${modules}/playwright-core`) || !existsSync(browserPath)) {
  console.error(`RENDER2MPEG and SCENE, ${modules}/playwright-core and ${browserPath} are needed: set MODULES and CHROMIUM`);
  process.exit(1);
}
const { chromium } = createRequire(`${modules}/`)("playwright-core");
const start = () => serve(program, scene, options);
const print = (figures) => console.log(JSON.stringify(figures, (_, x) => (typeof x === "number" ? Number(x.toPrecision(4)) : x)));
const SIZES = [[1280, 720], [390, 844]];

async function keys(browser) {
  const { server, link } = await start();
  const tab = await open(browser, link);
  // Until the light of the scene is complete, it takes time from the pictures.
  await idle(server);
  const presses = [];
  const end = performance.now() + 1000 * seconds(90);
  for (let k = 0; k < 40 && performance.now() < end; k++) {
    await rest(tab);
    await take(tab);
    const { input } = await tab.evaluate(() => window.drawn.at(-1));
    await tab.keyboard.down(k % 2 ? "ArrowLeft" : "ArrowRight");
    // A refinement that was under way does not contain the key.
    const contains = (input) => window.drawn.find((picture) => picture.input > input && picture.is_changed);
    await tab.waitForFunction(contains, input, { timeout: 60000 });
    presses.push(await tab.evaluate((input) => {
      const first = window.drawn.find((picture) => picture.input > input && picture.is_changed);
      return { ...first, latency: first.at - window.pressed };
    }, input));
    await tab.keyboard.up(k % 2 ? "ArrowLeft" : "ArrowRight");
  }

  // The means add up: rendering and coding, decoding, and the rest, in which an unfinished refinement delays the key.
  const of = (name) => presses.map((press) => press[name]);
  const waits = presses.map(({ latency, rendered, decoded }) => latency - rendered - decoded);
  const resting = presses.filter((_, k) => waits[k] < 40);
  await take(tab);
  await sway(tab, 5);
  const moving = (await take(tab)).filter(({ moves }) => moves);
  print({
    presses: presses.length, median_ms: quantile(of("latency"), 0.5), p95_ms: quantile(of("latency"), 0.95), worst_ms: Math.max(...of("latency")),
    mean_ms: mean(of("latency")), first_rendered_ms: mean(of("rendered")), first_decoded_ms: mean(of("decoded")), waited_ms: mean(waits),
    at_rest: resting.length, at_rest_median_ms: quantile(resting.map(({ latency }) => latency), 0.5),
    pictures_per_s: moving.length / 5, cpu_ms: 1000 * mean(moving.map(({ cpu }) => cpu)), rendered_ms: mean(moving.map(({ rendered }) => rendered)),
    decoded_ms: mean(moving.map(({ decoded }) => decoded)), quantiser: mean(moving.map(({ quantiser }) => quantiser)),
  });
  server.kill("SIGINT");
}

async function atRest(browser) {
  const { server, link, at } = await start();
  const tab = await open(browser, link);
  print({ first_picture_in_page_ms: performance.now() - at });
  await idle(server);
  await sway(tab, 1.5);
  const released = await tab.evaluate(() => performance.now());
  await idle(server);
  const drawn = await tab.evaluate(() => window.drawn.slice(-4));
  const [before, count] = [cpuSeconds(server.pid), await tab.evaluate(() => window.drawn.length)];
  await pause(2000);
  print({
    rest_ms: drawn.at(-1).at - released, quantisers: drawn.map(({ quantiser }) => quantiser), bits: drawn.map(({ bits }) => bits),
    idle_cpu_s: cpuSeconds(server.pid) - before, idle_pictures: (await tab.evaluate(() => window.drawn.length)) - count,
  });
  server.kill("SIGINT");
}

async function lines(browser) {
  const { server, link } = await start();
  const address = new URL(link);
  const { line, relay, port } = await proxy(Number(address.port), 4e6);
  address.port = port;
  const tab = await open(browser, address.href);
  await sway(tab, 4);
  const [samples, begin, each] = [[], performance.now(), seconds(200)];
  for (const rate of [4e6, 1e6, 3e5]) {
    line.rate = rate;
    const end = performance.now() + 1000 * each;
    await take(tab);
    const swaying = sway(tab, each);
    for (let second = 0; performance.now() < end; second++) {
      // All lines show the same views: the view drifts with the number of pictures.
      if (second % 10 === 0) await tab.keyboard.press("KeyR");
      // The queue is seen every 10 ms, all else once a second.
      let queued = 0;
      for (let k = 0; k < 100; k++) {
        queued = Math.max(queued, line.queued);
        await pause(10);
      }
      const moving = (await take(tab)).filter(({ moves }) => moves);
      const of = (name) => moving.map((picture) => picture[name]);
      samples.push({
        at: (performance.now() - begin) / 1000, rate, pictures: moving.length, quantiser: mean(of("quantiser")), cpu: 1000 * mean(of("cpu")),
        delay: Math.max(0, ...of("roundTrip")), kbit: of("bits").reduce((sum, bits) => sum + bits, 0) / 1000, queued: queued / 1000, memory: memory(server.pid),
      });
    }
    await swaying;
    const own = samples.filter((sample) => sample.rate === rate && sample.pictures);
    const list = (name) => own.map((sample) => sample[name]);
    print({
      rate, pictures_per_s: mean(list("pictures")), quantiser: mean(list("quantiser")), cpu_ms: mean(list("cpu")), kbit_per_s: mean(list("kbit")),
      delay_median_ms: quantile(list("delay"), 0.5), delay_p95_ms: quantile(list("delay"), 0.95), delay_worst_ms: Math.max(...list("delay")),
      queued_worst_kbit: Math.max(...list("queued")), memory_mb: [own[0].memory, own.at(-1).memory], seconds_without_picture: samples.filter((sample) => sample.rate === rate && !sample.pictures).length,
    });
  }
  writeFileSync("serve-lines.json", JSON.stringify(samples));
  writeFileSync("serve-lines.svg", plot(samples));
  await tab.close();
  server.kill("SIGINT");
  relay.close();
}

async function walk(browser) {
  const { server, link } = await start();
  for (const [width, height] of SIZES) {
    const tab = await open(browser, link, { width, height });
    await rest(tab);
    await take(tab);
    for (const [number, held] of [["KeyW"], ["KeyW", "ArrowLeft"], ["ArrowLeft"], ["KeyS", "ArrowRight"], ["KeyD"]].entries()) {
      for (const key of held) await tab.keyboard.down(key);
      await pause(1000);
      await tab.screenshot({ path: `serve-walk-${width}-${number}.png` });
      await pause(500);
      for (const key of held) await tab.keyboard.up(key);
    }
    const drawn = await take(tab);
    const pauses = drawn.slice(1).map(({ at }, k) => at - drawn[k].at);
    print({
      width, pictures: drawn.length, longest_pause_ms: Math.max(...pauses), darkest: Math.min(...drawn.map(({ brightness }) => brightness)),
      brightest: Math.max(...drawn.map(({ brightness }) => brightness)), unchanged_in_motion: drawn.filter(({ moves, is_changed }) => moves && !is_changed).length,
    });
    await tab.keyboard.press("KeyR");
    await tab.close();
  }
  server.kill("SIGINT");
}

async function screens(browser) {
  const { server, link } = await start();
  for (const [width, height] of SIZES) {
    const tab = await open(browser, link, { width, height });
    await tab.keyboard.press("f");
    await rest(tab);
    await pause(500);
    await tab.screenshot({ path: `serve-${width}.png` });
    await tab.close();
  }
  server.kill("SIGINT");
}

const browser = await chromium.launch({
  executablePath: browserPath,
  args: ["--no-sandbox", "--disable-quic", "--disable-background-networking", "--disable-component-update", "--disable-sync"],
});
try {
  await { keys, rest: atRest, lines, walk, screens }[what](browser);
} finally {
  await browser.close();
}
