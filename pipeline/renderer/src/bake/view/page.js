"use strict";
// Viewer of a baked scene. The elements of the page contain the shaders, the description of the scene and its data.
const element = (id) => document.getElementById(id);
const scene = JSON.parse(element("scene").textContent);
const canvas = element("picture");
const message = element("message");

function fail(text) {
  message.textContent = text;
  message.hidden = false;
  window.failure = text;
}

// Vectors and matrices. Matrices have 16 numbers by columns.
const add = (a, b, s = 1) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
const scaled = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const normalized = (a) => scaled(a, 1 / (Math.hypot(...a) || 1));

// Decodes the data: base64, zlib, then the differences in the columns of each block.
async function decoded() {
  const text = atob(element("data").textContent);
  element("data").textContent = "";
  const packed = Uint8Array.from(text, (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  const blocks = {};
  for (const [name, { first, count, stride }] of Object.entries(scene.blocks)) {
    if (stride === 0) {
      blocks[name] = bytes.subarray(first, first + count);
      continue;
    }
    const records = new Uint8Array(count * stride);
    for (let column = 0, from = first; column < stride; column++) {
      for (let record = 0, at = column, byte = 0; record < count; record++, at += stride) {
        byte = (byte + bytes[from++]) & 255;
        records[at] = byte;
      }
    }
    blocks[name] = records;
  }
  return blocks;
}
