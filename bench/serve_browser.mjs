// Server, slow line and browser for `serve.mjs`.
import { spawn } from "node:child_process";
import { readFileSync } from "node:fs";
import { connect, createServer } from "node:net";

export const pause = (ms) => new Promise((done) => setTimeout(done, ms));
export const quantile = (list, share) => [...list].sort((a, b) => a - b)[Math.min(list.length - 1, Math.floor(share * list.length))];
export const mean = (list) => list.reduce((sum, x) => sum + x, 0) / Math.max(list.length, 1);

// Servers end with this script, however it ends.
const servers = new Set();
process.on("exit", () => servers.forEach((server) => server.kill("SIGKILL")));

// Starts the server and returns its process, its link and the time of the link.
export async function serve(program, scene, options) {
  const server = spawn(program, ["serve", scene, "--listen", "127.0.0.1:0", "--quiet", ...options]);
  servers.add(server);
  server.on("exit", () => servers.delete(server));
  server.stderr.on("data", (text) => process.stderr.write(text));
  const link = await new Promise((done, fail) => {
    server.stdout.once("data", (text) => done(String(text).trim()));
    server.once("exit", (code) => fail(new Error(`the server ended with code ${code}`)));
  });
  return { server, link, at: performance.now() };
}

// CPU time of a process so far, in seconds.
export function cpuSeconds(pid) {
  const fields = readFileSync(`/proc/${pid}/stat`, "utf8").split(") ")[1].split(" ");
  return (Number(fields[11]) + Number(fields[12])) / 100;
}

// Memory of a process in use, in MB.
export function memory(pid) {
  return Number(/VmRSS:\s*(\d+)/.exec(readFileSync(`/proc/${pid}/status`, "utf8"))[1]) / 1024;
}

// Relays connections to the port `target`. Data to the client passes at `line.rate` bits/s in order, with a delay of
// 10 ms. `line.queued` is the number of waiting bits.
export async function proxy(target, rate) {
  const line = { rate, free: 0, queued: 0 };
  const relay = createServer((client) => {
    const server = connect(target, "127.0.0.1");
    client.setNoDelay(true);
    server.setNoDelay(true);
    client.on("data", (data) => setTimeout(() => server.write(data), 10));
    server.on("data", (data) => {
      const bits = 8 * data.length;
      line.queued += bits;
      line.free = Math.max(line.free, performance.now()) + (1000 * bits) / line.rate;
      setTimeout(() => {
        line.queued -= bits;
        client.write(data);
      }, line.free - performance.now() + 10);
    });
    for (const [one, other] of [[client, server], [server, client]]) one.on("close", () => other.destroy()).on("error", () => other.destroy());
  });
  await new Promise((done) => relay.listen(0, "127.0.0.1", done));
  return { line, relay, port: relay.address().port };
}

// Opens the page, which then records each drawn picture in `drawn`, with its header.
export async function open(browser, link, viewport = { width: 1280, height: 720 }) {
  const tab = await browser.newPage({ viewport });
  tab.on("pageerror", (error) => console.error(`error: ${error.message}`));
  tab.on("console", (line) => line.text().includes("GPU stall") || console.error(`console: ${line.text()}`));
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
          const brightness = luma.reduce((sum, y) => sum + y, 0) / luma.length;
          // Handlers run in order: the page has drawn the picture when this task ends.
          setTimeout(() => window.drawn.push({ at: performance.now(), is_changed: !last || luma.some((y, i) => y !== last[i]), brightness, ...data.figures }));
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
export async function rest(tab) {
  await tab.waitForFunction(() => performance.now() - window.drawn.at(-1).at > 500, null, { timeout: 60000 });
}

// Waits until the server has used almost no CPU time for half a second: a picture of a large scene may take longer than
// the pause that `rest` waits for.
export async function idle({ pid }) {
  for (let before = -1; cpuSeconds(pid) - before > 0.02; ) {
    before = cpuSeconds(pid);
    await pause(500);
  }
}

// Takes the recorded pictures of a tab, except the last one.
export function take(tab) {
  return tab.evaluate(() => window.drawn.splice(0, window.drawn.length - 1));
}

// Turns the camera to and fro for some seconds.
export async function sway(tab, seconds) {
  const end = performance.now() + 1000 * seconds;
  for (let k = 0; performance.now() < end; k++) {
    const key = k % 2 ? "ArrowLeft" : "ArrowRight";
    await tab.keyboard.down(key);
    await pause(k ? 500 : 250);
    await tab.keyboard.up(key);
  }
}
