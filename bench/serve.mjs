// Measures `render2mpeg serve` in a headless browser: latency of keys, pictures a second, idle cost, and lines of several rates.
//
//     node bench/serve.mjs RENDER2MPEG SCENE.glb [keys|rest|lines|screens] [OPTIONS OF serve]
//
// keys     time from a key event to the first changed pixel, and pictures a second while the camera turns
// rest     time until the last picture at rest, and CPU time of the server in 2 s of idleness
// lines    quantiser, CPU time of a picture and delay behind a proxy with 4 Mbit/s, 1 Mbit/s and 300 kbit/s
// screens  pictures of the page at 1280 and 390 pixels, in the current folder
// MODULES is the folder of the package playwright-core (default: node_modules), CHROMIUM the browser.
import { spawn } from "node:child_process";
import { existsSync, readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { connect, createServer } from "node:net";
import { resolve } from "node:path";

const [program, scene, what = "keys", ...options] = process.argv.slice(2);
const modules = resolve(process.env.MODULES ?? "node_modules");
const browserPath = process.env.CHROMIUM ?? "/usr/bin/chromium";
if (!scene || !existsSync(`${modules}/playwright-core`) || !existsSync(browserPath)) {
  console.error(`RENDER2MPEG and SCENE, ${modules}/playwright-core and ${browserPath} are needed: set MODULES and CHROMIUM`);
  process.exit(1);
}
const { chromium } = createRequire(`${modules}/`)("playwright-core");
const pause = (ms) => new Promise((done) => setTimeout(done, ms));
const quantile = (list, share) => [...list].sort((a, b) => a - b)[Math.min(list.length - 1, Math.floor(share * list.length))];
const mean = (list) => list.reduce((sum, x) => sum + x, 0) / Math.max(list.length, 1);

// Starts the server and returns its address and process.
async function serve(port) {
  const server = spawn(program, ["serve", scene, "--listen", `127.0.0.1:${port}`, "--quiet", ...options]);
  server.stderr.on("data", (text) => process.stderr.write(text));
  const link = await new Promise((done) => server.stdout.once("data", (text) => done(String(text).trim())));
  return { server, link, at: performance.now() };
}

// CPU time of a process so far, in seconds.
function cpuSeconds(pid) {
  const fields = readFileSync(`/proc/${pid}/stat`, "utf8").split(") ")[1].split(" ");
  return (Number(fields[11]) + Number(fields[12])) / 100;
}

// Relays connections to `port`. Data to the client passes at `rate` bits/s in order, with a delay of 10 ms.
function proxy(port, target, rate) {
  const line = { rate, free: 0 };
  const relay = createServer((client) => {
    const server = connect(target, "127.0.0.1");
    client.setNoDelay(true);
    server.setNoDelay(true);
    client.on("data", (data) => setTimeout(() => server.write(data), 10));
    server.on("data", (data) => {
      line.free = Math.max(line.free, performance.now()) + (8000 * data.length) / line.rate;
      setTimeout(() => client.write(data), line.free - performance.now() + 10);
    });
    for (const [one, other] of [[client, server], [server, client]]) one.on("close", () => other.destroy()).on("error", () => other.destroy());
  });
  relay.listen(port, "127.0.0.1");
  return { line, relay };
}

// Opens the page, which then records each drawn picture in `drawn`, with its header.
async function open(browser, link, viewport = { width: 1280, height: 720 }) {
  const tab = await browser.newPage({ viewport });
  tab.on("pageerror", (error) => console.error(`error: ${error.message}`));
  tab.on("console", (line) => console.error(`console: ${line.text()}`));
  await tab.addInitScript(() => {
    window.drawn = [];
    const Native = Worker;
    window.Worker = class extends Native {
      constructor(...words) {
        super(...words);
        this.addEventListener("message", ({ data }) => {
          if (!data.picture) return;
          const luma = data.picture.y.slice();
          const last = window.luma;
          window.luma = luma;
          // Handlers run in order: the page has drawn the picture when this task ends.
          setTimeout(() => window.drawn.push({ at: performance.now(), is_changed: !last || luma.some((y, i) => y !== last[i]), ...data.figures }));
        });
      }
    };
    addEventListener("keydown", () => (window.pressed = performance.now()), true);
  });
  await tab.goto(link);
  await tab.waitForFunction(() => window.drawn.length > 0, null, { timeout: 120000 });
  return tab;
}

// Waits until no picture came for half a second.
async function rest(tab) {
  await tab.waitForFunction(() => performance.now() - window.drawn.at(-1).at > 500, null, { timeout: 60000 });
}

// Turns the camera to and fro for some seconds.
async function sway(tab, seconds) {
  const end = performance.now() + 1000 * seconds;
  for (let k = 0; performance.now() < end; k++) {
    const key = k % 2 ? "ArrowLeft" : "ArrowRight";
    await tab.keyboard.down(key);
    await pause(k ? 500 : 250);
    await tab.keyboard.up(key);
  }
}

async function keys(browser) {
  const { server, link } = await serve(0);
  const tab = await open(browser, link);
  await rest(tab);
  const [latencies, waited, rendered] = [[], [], []];
  for (let k = 0; k < 40; k++) {
    await rest(tab);
    await tab.evaluate(() => (window.drawn = [window.drawn.at(-1)]));
    await tab.keyboard.down(k % 2 ? "ArrowLeft" : "ArrowRight");
    await tab.waitForFunction(() => window.drawn.slice(1).some(({ is_changed }) => is_changed));
    const first = await tab.evaluate(() => ({ ...window.drawn.slice(1).find(({ is_changed }) => is_changed), pressed: window.pressed }));
    latencies.push(first.at - first.pressed);
    waited.push(first.waited);
    rendered.push(first.rendered);
    await tab.keyboard.up(k % 2 ? "ArrowLeft" : "ArrowRight");
  }
  await tab.evaluate(() => (window.drawn = [window.drawn.at(-1)]));
  await sway(tab, 5);
  const drawn = await tab.evaluate(() => window.drawn);
  const moving = drawn.filter(({ moves }) => moves);
  const span = (moving.at(-1).at - moving[0].at) / 1000;
  console.log(JSON.stringify({
    keys: latencies.length, median_ms: quantile(latencies, 0.5), p95_ms: quantile(latencies, 0.95), worst_ms: Math.max(...latencies),
    waited_ms: quantile(waited, 0.5), first_rendered_ms: quantile(rendered, 0.5),
    pictures_per_s: (moving.length - 1) / span, cpu_ms: 1000 * mean(moving.map(({ cpu }) => cpu)), rendered_ms: mean(moving.map(({ rendered }) => rendered)),
    decoded_ms: mean(moving.map(({ decoded }) => decoded)), quantiser: mean(moving.map(({ quantiser }) => quantiser)),
  }));
  server.kill("SIGINT");
}

async function atRest(browser) {
  const { server, link, at } = await serve(0);
  const tab = await open(browser, link);
  console.log(JSON.stringify({ first_picture_in_page_ms: performance.now() - at }));
  await rest(tab);
  await sway(tab, 1.5);
  const released = await tab.evaluate(() => performance.now());
  await rest(tab);
  const drawn = await tab.evaluate(() => window.drawn.slice(-4));
  const [before, count] = [cpuSeconds(server.pid), await tab.evaluate(() => window.drawn.length)];
  await pause(2000);
  console.log(JSON.stringify({
    rest_ms: drawn.at(-1).at - released, quantisers: drawn.map(({ quantiser }) => quantiser), bits: drawn.map(({ bits }) => bits),
    idle_cpu_s: cpuSeconds(server.pid) - before, idle_pictures: (await tab.evaluate(() => window.drawn.length)) - count,
  }));
  server.kill("SIGINT");
}

async function lines(browser) {
  for (const rate of [4e6, 1e6, 3e5]) {
    const { server, link } = await serve(0);
    const { relay } = proxy(0, Number(new URL(link).port), rate);
    await new Promise((done) => relay.once("listening", done));
    const address = new URL(link);
    address.port = relay.address().port;
    const tab = await open(browser, address.href);
    await sway(tab, 4);
    await tab.evaluate(() => (window.drawn = []));
    await sway(tab, 6);
    const drawn = (await tab.evaluate(() => window.drawn)).filter(({ moves }) => moves);
    const trips = drawn.map(({ roundTrip }) => roundTrip);
    console.log(JSON.stringify({
      rate, pictures_per_s: drawn.length / 6, quantiser: mean(drawn.map(({ quantiser }) => quantiser)),
      kbit_per_s: drawn.reduce((sum, { bits }) => sum + bits, 0) / 6000, cpu_ms: 1000 * mean(drawn.map(({ cpu }) => cpu)),
      delay_ms: mean(trips), delay_p95_ms: quantile(trips, 0.95), delay_worst_ms: Math.max(...trips),
    }));
    await tab.close();
    server.kill("SIGINT");
    relay.close();
  }
}

async function screens(browser) {
  const { server, link } = await serve(0);
  for (const [width, height] of [[1280, 720], [390, 844]]) {
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
  await { keys, rest: atRest, lines, screens }[what](browser);
} finally {
  await browser.close();
}
