// Shows glTF files in three.js, each with a given camera, in one headless browser.
//
//     node bench/gltf_views.mjs JOBS.json > RESULTS.jsonl
//
// A job has: file, output, width, height; camera_from_world (right-handed, 16 numbers by columns), projection (16 numbers by columns);
// seconds, the time in the first animation. The page has a uniform white light if the file has no lamp, and a transparent
// background. With room: light of three.js's RoomEnvironment, a gray background, antialiasing and a tone curve. A result has the job's file, and data or a failure.
// MODULES is the folder of the packages three and playwright-core (default: node_modules), CHROMIUM the browser.
import { createServer } from "node:http";
import { createReadStream, existsSync, readFileSync, statSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { basename, dirname, resolve } from "node:path";

const jobs = JSON.parse(readFileSync(process.argv[2], "utf8"));
const modules = resolve(process.env.MODULES ?? "node_modules");
const browserPath = process.env.CHROMIUM ?? "/usr/bin/chromium";
if (!existsSync(`${modules}/three`) || !existsSync(`${modules}/playwright-core`) || !existsSync(browserPath)) {
  console.error(`${modules}/three, ${modules}/playwright-core and ${browserPath} are needed: set MODULES and CHROMIUM`);
  process.exit(1);
}
const { chromium } = createRequire(`${modules}/`)("playwright-core");

const page = (job, index) => `<!DOCTYPE html><body style="margin:0"><script type="importmap">
{ "imports": { "three": "/modules/three/build/three.module.js", "three/addons/": "/modules/three/examples/jsm/" } }
</script><script type="module">
import * as THREE from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { DRACOLoader } from "three/addons/loaders/DRACOLoader.js";
import { KTX2Loader } from "three/addons/loaders/KTX2Loader.js";
import { RoomEnvironment } from "three/addons/environments/RoomEnvironment.js";
import { MeshoptDecoder } from "three/addons/libs/meshopt_decoder.module.js";
const renderer = new THREE.WebGLRenderer({ alpha: true, antialias: ${Boolean(job.room)}, preserveDrawingBuffer: true });
renderer.setPixelRatio(1);
renderer.setSize(${job.width}, ${job.height}, false);
renderer.setClearColor(0x000000, 0);
renderer.toneMapping = ${job.room ? "THREE.NeutralToneMapping" : "THREE.NoToneMapping"};
renderer.outputColorSpace = THREE.SRGBColorSpace;
document.body.append(renderer.domElement);
try {
  const loader = new GLTFLoader();
  loader.setDRACOLoader(new DRACOLoader().setDecoderPath("/modules/three/examples/jsm/libs/draco/gltf/"));
  loader.setKTX2Loader(new KTX2Loader().setTranscoderPath("/modules/three/examples/jsm/libs/basis/").detectSupport(renderer));
  loader.setMeshoptDecoder(MeshoptDecoder);
  const gltf = await loader.loadAsync("/job/${index}/${encodeURIComponent(basename(job.file))}");
  const root = gltf.scene ?? gltf.scenes[0];
  if (!root) throw new Error("the file has no scene");
  const scene = new THREE.Scene();
  scene.add(root);
  let lamps = 0;
  root.traverse((one) => { lamps += one.isLight ? 1 : 0; });
  if (${Boolean(job.room)}) {
    scene.environment = new THREE.PMREMGenerator(renderer).fromScene(new RoomEnvironment(), 0.04).texture;
    scene.background = new THREE.Color(0xcccccc);
    lamps++;
  }
  // A white hemisphere and directional light: shapes matter here, and an environment costs seconds in software.
  if (!lamps) {
    const sun = new THREE.DirectionalLight(0xffffff, 2);
    sun.position.set(1, 2, 3);
    scene.add(sun, new THREE.HemisphereLight(0xffffff, 0x606060, 2));
  }
  if (gltf.animations.length) {
    const mixer = new THREE.AnimationMixer(root);
    mixer.clipAction(gltf.animations[0]).play();
    mixer.setTime(${job.seconds ?? 0});
  }
  scene.updateMatrixWorld(true);
  const camera = new THREE.Camera();
  camera.matrixAutoUpdate = false;
  camera.matrixWorldInverse.fromArray(${JSON.stringify(job.camera_from_world)});
  camera.matrixWorld.copy(camera.matrixWorldInverse).invert();
  camera.matrix.copy(camera.matrixWorld);
  // Fit the depth range to the scene.
  const box = new THREE.Box3().setFromObject(scene, true).applyMatrix4(camera.matrixWorldInverse);
  const size = Math.max(1e-6, box.max.z - box.min.z);
  const perspective = ${job.projection[11]} !== 0;
  const far = -box.min.z + 0.01 * size;
  const near = perspective ? Math.max(-box.max.z - 0.01 * size, 1e-4 * far) : -box.max.z - 0.01 * size;
  const p = ${JSON.stringify(job.projection)};
  p[10] = perspective ? -(far + near) / (far - near) : -2 / (far - near);
  p[14] = perspective ? -2 * far * near / (far - near) : -(far + near) / (far - near);
  camera.projectionMatrix.fromArray(p);
  camera.projectionMatrixInverse.copy(camera.projectionMatrix).invert();
  renderer.render(scene, camera);
  window.shown = renderer.domElement.toDataURL("image/png");
  window.facts = { triangles: renderer.info.render.triangles, lamps };
} catch (error) {
  window.failure = String(error?.message ?? error);
}
</script>`;

const types = { ".js": "text/javascript", ".mjs": "text/javascript", ".wasm": "application/wasm", ".json": "application/json" };
const send = (response, path) => {
  if (path.includes("/../") || !existsSync(path) || !statSync(path).isFile()) {
    response.writeHead(404);
    response.end();
    return;
  }
  const ending = path.slice(path.lastIndexOf("."));
  response.writeHead(200, { "Content-Type": types[ending] ?? "application/octet-stream" });
  createReadStream(path).pipe(response);
};
// Serves the pages, the packages and the folders of the files, on this machine only.
const server = createServer((request, response) => {
  const path = decodeURIComponent(new URL(request.url, "http://localhost").pathname);
  const [, kind, index] = path.split("/");
  if (kind === "page") {
    response.writeHead(200, { "Content-Type": "text/html" });
    response.end(page(jobs[index], index));
  } else if (kind === "modules") {
    send(response, `${modules}/${path.slice("/modules/".length)}`);
  } else if (kind === "job" && jobs[index]) {
    send(response, `${dirname(jobs[index].file)}/${path.slice(`/job/${index}/`.length)}`);
  } else {
    send(response, "");
  }
});
await new Promise((listening) => server.listen(0, "127.0.0.1", listening));
const browser = await chromium.launch({
  executablePath: browserPath,
  args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
});
try {
  for (const [index, job] of jobs.entries()) {
    const tab = await browser.newPage();
    const result = { file: job.file };
    try {
      await tab.goto(`http://127.0.0.1:${server.address().port}/page/${index}`);
      await tab.waitForFunction(() => window.shown || window.failure, null, { timeout: 60000 });
      result.failure = (await tab.evaluate(() => window.failure)) ?? undefined;
      if (!result.failure) {
        writeFileSync(job.output, Buffer.from((await tab.evaluate(() => window.shown)).split(",")[1], "base64"));
        result.facts = await tab.evaluate(() => window.facts);
      }
    } catch (error) {
      result.failure = String(error?.message ?? error).split("\n")[0];
    }
    await tab.close();
    console.log(JSON.stringify(result));
  }
} finally {
  await browser.close();
  server.close();
}
