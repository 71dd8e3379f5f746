// Shows a .glb file in three.js, in a headless browser, and writes the picture as a PNG.
//
//     node bench/view_export.mjs FILE.glb OUT.png [WIDTHxHEIGHT] [SECONDS]
//
// The camera is the file's first, or the one named by CAMERA, at this time of its first animation. The page has no light and no tone
// curve. FROM=[x,y,z] is the position of a camera for a file without one, in radii from its center.
// MODULES is the folder of the packages three and playwright-core (default: node_modules), CHROMIUM the browser.
// LIGHTS=1 adds a uniform light, for surfaces without baked light.
import { createServer } from "node:http";
import { createReadStream, existsSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { resolve } from "node:path";

const [file, output, size = "512x512", seconds = "0"] = process.argv.slice(2);
const modules = resolve(process.env.MODULES ?? "node_modules");
const browserPath = process.env.CHROMIUM ?? "/usr/bin/chromium";
if (!file || !output || !existsSync(file)) {
  console.error("usage: node bench/view_export.mjs FILE.glb OUT.png [WIDTHxHEIGHT] [SECONDS]");
  process.exit(2);
}
if (!existsSync(modules) || !existsSync(browserPath)) {
  console.error(`${modules} and ${browserPath} are needed: set MODULES and CHROMIUM`);
  process.exit(1);
}
const { chromium } = createRequire(`${modules}/`)("playwright-core");
const [width, height] = size.split("x").map(Number);

const page = `<!DOCTYPE html><body style="margin:0"><script type="importmap">
{ "imports": { "three": "/modules/three/build/three.module.js", "three/addons/": "/modules/three/examples/jsm/" } }
</script><script type="module">
import * as THREE from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
const renderer = new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
renderer.setSize(${width}, ${height}, false);
renderer.toneMapping = THREE.NoToneMapping;
renderer.outputColorSpace = THREE.SRGBColorSpace;
document.body.append(renderer.domElement);
try {
  const gltf = await new GLTFLoader().loadAsync("/file.glb");
  const scene = new THREE.Scene();
  scene.background = new THREE.Color(0);
  scene.add(gltf.scene);
  if (${process.env.LIGHTS === "1"}) scene.add(new THREE.AmbientLight(0xffffff, 2));
  if (gltf.animations.length) {
    const mixer = new THREE.AnimationMixer(gltf.scene);
    mixer.clipAction(gltf.animations[0]).play();
    mixer.setTime(${Number(seconds)});
  }
  scene.updateMatrixWorld(true);
  const wanted = ${JSON.stringify(process.env.CAMERA ?? "")};
  const isWanted = (camera) => [camera.name, camera.parent?.name].includes(wanted);
  let camera = gltf.cameras.find(isWanted) ?? gltf.cameras[0];
  if (!camera) {
    const box = new THREE.Box3().setFromObject(scene);
    const center = box.getCenter(new THREE.Vector3()), radius = box.getSize(new THREE.Vector3()).length() / 2;
    camera = new THREE.PerspectiveCamera(50, 1, radius / 1000, radius * 10);
    camera.position.copy(center).addScaledVector(new THREE.Vector3(...${process.env.FROM ?? "[0.9, 0.1, 0]"}), radius);
    camera.lookAt(center);
    camera.updateMatrixWorld(true);
  }
  camera.aspect = ${width} / ${height};
  camera.updateProjectionMatrix();
  renderer.render(scene, camera);
  window.shown = renderer.domElement.toDataURL("image/png");
  window.facts = renderer.info.render;
} catch (error) {
  window.failure = String(error?.stack ?? error);
}
</script>`;

// Serves the page, the packages and the file, on this machine only.
const send = (response, path, type) => {
  response.writeHead(200, { "Content-Type": type });
  createReadStream(path).pipe(response);
};
const server = createServer((request, response) => {
  const path = decodeURIComponent(new URL(request.url, "http://localhost").pathname);
  if (path === "/") {
    response.writeHead(200, { "Content-Type": "text/html" });
    response.end(page);
  } else if (path === "/file.glb") {
    send(response, file, "model/gltf-binary");
  } else if (path.startsWith("/modules/") && !path.includes("..") && existsSync(`${modules}/${path.slice(9)}`)) {
    send(response, `${modules}/${path.slice(9)}`, "text/javascript");
  } else {
    response.writeHead(404);
    response.end();
  }
});
await new Promise((listening) => server.listen(0, "127.0.0.1", listening));
const browser = await chromium.launch({
  executablePath: browserPath,
  args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
});
try {
  const tab = await browser.newPage();
  await tab.goto(`http://127.0.0.1:${server.address().port}/`);
  await tab.waitForFunction(() => window.shown || window.failure, null, { timeout: 120000 });
  const failure = await tab.evaluate(() => window.failure);
  if (failure) throw new Error(failure);
  const shown = await tab.evaluate(() => window.shown);
  writeFileSync(output, Buffer.from(shown.split(",")[1], "base64"));
  console.log(JSON.stringify(await tab.evaluate(() => window.facts)));
} finally {
  await browser.close();
  server.close();
}
