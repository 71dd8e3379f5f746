// Shows a page of `render2mpeg bake --view` in a headless browser: writes a picture of its first view as a PNG, and prints the time of a frame.
//
//     node bench/view_page.mjs PAGE.html OUT.png [WIDTHxHEIGHT] [FRAMES]
//
// The picture has shadow rays, and the timed frames of a moving camera have none.
// COATS is the light of coats: 0 maps, lamps and rays (default), 3 maps and lamps, 1 segments and lamps, 2 off. SCREEN=FILE.png also writes the whole window.
// MODULES is the folder of the package playwright-core (default: node_modules), CHROMIUM the browser.
import { existsSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { resolve } from "node:path";
import { pathToFileURL } from "node:url";

const [page, output, size = "512x512", frames = "20"] = process.argv.slice(2);
const [width, height] = size.split("x").map(Number);
const modules = resolve(process.env.MODULES ?? "node_modules");
const browserPath = process.env.CHROMIUM ?? "/usr/bin/chromium";
if (!output || !existsSync(`${modules}/playwright-core`) || !existsSync(browserPath)) {
  console.error(`PAGE.html and OUT.png, ${modules}/playwright-core and ${browserPath} are needed: set MODULES and CHROMIUM`);
  process.exit(1);
}
const { chromium } = createRequire(`${modules}/`)("playwright-core");
const browser = await chromium.launch({
  executablePath: browserPath,
  args: ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
});
try {
  const tab = await browser.newPage({ viewport: { width: Number(process.env.WIDTH ?? 1000), height: 700 } });
  // Report errors of the page, and any attempt to use the network.
  tab.on("pageerror", (error) => console.error(`error: ${error.message}`));
  tab.on("console", (line) => console.error(`console: ${line.text()}`));
  tab.on("request", (request) => request.url().startsWith("file:") || console.error(`request: ${request.url()}`));
  await tab.goto(pathToFileURL(resolve(page)).href);
  await tab.waitForFunction(() => window.isReady || window.failure, null, { timeout: 120000 });
  const failure = await tab.evaluate(() => window.failure);
  if (failure) throw new Error(failure);
  await tab.evaluate((mode) => window.setCoats(mode), Number(process.env.COATS ?? 0));
  const picture = await tab.evaluate(([width, height]) => {
    const still = window.renderStill(width, height);
    const canvas = Object.assign(document.createElement("canvas"), { width, height });
    canvas.getContext("2d").putImageData(new ImageData(still.data, width, height), 0, 0);
    return canvas.toDataURL("image/png");
  }, [width, height]);
  writeFileSync(output, Buffer.from(picture.split(",")[1], "base64"));
  if (process.env.SCREEN) {
    await tab.waitForTimeout(2000);
    await tab.screenshot({ path: process.env.SCREEN, timeout: 120000 });
  }
  const time = await tab.evaluate(([count, width, height]) => window.measureFrames(count, width, height), [Number(frames), width, height]);
  const device = await tab.evaluate(() => {
    const gl = document.createElement("canvas").getContext("webgl2");
    return gl.getParameter(gl.getExtension("WEBGL_debug_renderer_info")?.UNMASKED_RENDERER_WEBGL ?? gl.RENDERER);
  });
  console.log(JSON.stringify({ page, frame_ms: time, frames_per_s: 1000 / time, device }));
} finally {
  await browser.close();
}
