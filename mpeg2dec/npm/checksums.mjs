// Decodes a file with the WebAssembly module and prints the FNV-1a checksum of the samples of each picture.
import { readFile } from "node:fs/promises";
import { Decoder } from "./mpeg2dec.js";

const decoder = await Decoder.create(await readFile(new URL("mpeg2dec.wasm", import.meta.url)));
const stream = await readFile(process.argv[2]);
let [pictures, milliseconds] = [0, 0];

function print(picture) {
  let sum = 0x811c9dc5;
  for (const plane of [picture.y, picture.cb, picture.cr])
    for (const sample of plane) sum = Math.imul(sum ^ sample, 0x01000193) >>> 0;
  console.log(sum.toString(16).padStart(8, "0"), picture.type, picture.width, picture.height);
}

function* all() {
  yield* decoder.decode(stream);
  yield* decoder.flush();
}
if (process.argv[3] === "--time") {
  const start = performance.now();
  for (const _ of all()) pictures++;
  milliseconds = performance.now() - start;
  console.log(`${pictures} pictures, ${(milliseconds / pictures).toFixed(2)} ms per picture`);
} else {
  for (const picture of all()) print(picture);
}
