// Writes meshopt.glb, draco.glb and images.glb: each packed item has a plain twin, unpacked by a reference decoder.
// Requires node and the npm packages meshoptimizer 1.3.0, draco3dgltf 1.5.7, ktx2-encoder 0.6.0, sharp 0.35.5 (libwebp)
// and three 0.187.0 (Basis transcoder): node packed.mjs
import draco3d from 'draco3dgltf';
import { encodeToKTX2 } from 'ktx2-encoder';
import { MeshoptDecoder, MeshoptEncoder } from 'meshoptimizer';
import fs from 'fs';
import path from 'path';
import sharp from 'sharp';
import { createRequire } from 'module';

/** glTF document that is built step by step. */
class File {
  constructor() {
    this.json = {
      asset: { version: '2.0', generator: 'packed.mjs' }, scene: 0, scenes: [{ nodes: [] }], nodes: [], meshes: [],
      accessors: [], bufferViews: [], buffers: [{ byteLength: 0 }],
    };
    this.parts = [];
    this.length = 0;
  }
  push(list, item) {
    this.json[list] ??= [];
    return this.json[list].push(item) - 1;
  }
  bytes(data) {
    const pad = (4 - (this.length % 4)) % 4;
    this.parts.push(Buffer.alloc(pad), Buffer.from(data.buffer, data.byteOffset, data.byteLength));
    const byteOffset = this.length + pad;
    this.length = byteOffset + data.byteLength;
    return { byteOffset, byteLength: data.byteLength };
  }
  view(data, more = {}) {
    return this.push('bufferViews', { buffer: 0, ...this.bytes(data), ...more });
  }
  accessor(bufferView, componentType, type, count, more = {}) {
    return this.push('accessors', { bufferView, componentType, type, count, ...more });
  }
  mesh(name, primitive, node = {}) {
    const mesh = this.push('meshes', { name, primitives: [primitive] });
    const index = this.push('nodes', { mesh, ...node });
    this.json.scenes[0].nodes.push(index);
    return index;
  }
  write(name) {
    this.json.buffers[0].byteLength = this.length;
    let text = JSON.stringify(this.json);
    text += ' '.repeat((4 - (text.length % 4)) % 4);
    const bin = Buffer.concat([...this.parts, Buffer.alloc((4 - (this.length % 4)) % 4)]);
    const head = Buffer.alloc(20), middle = Buffer.alloc(8);
    [0x46546c67, 2, 28 + text.length + bin.length, text.length, 0x4e4f534a].forEach((x, i) => head.writeUInt32LE(x, 4 * i));
    [bin.length, 0x004e4942].forEach((x, i) => middle.writeUInt32LE(x, 4 * i));
    fs.writeFileSync(name, Buffer.concat([head, Buffer.from(text), middle, bin]));
  }
}

/** Builds a bent grid of w by h squares. */
function grid(w, h) {
  const g = { position: [], normal: [], uv: [], color: [], joints: [], weights: [], indices: [] };
  for (let y = 0; y <= h; y++) for (let x = 0; x <= w; x++) {
    g.position.push(x / w, y / h, 0.2 * Math.sin(0.7 * x) * Math.cos(0.5 * y));
    const n = [0.4 * Math.cos(x), 0.3 * Math.sin(2 * y), 1], l = Math.hypot(...n);
    g.normal.push(...n.map((c) => c / l), 1);
    g.uv.push(x / w, y / h);
    g.color.push((37 * x) & 255, (91 * y) & 255, (13 * x * y) & 255, 255 - 5 * x);
    g.joints.push(x % 3, y % 3, 0, 0);
    g.weights.push(x / w, 1 - x / w, 0, 0);
  }
  for (let y = 0; y < h; y++) for (let x = 0; x < w; x++) {
    const a = y * (w + 1) + x;
    g.indices.push(a, a + 1, a + w + 2, a, a + w + 2, a + w + 1);
  }
  return g;
}

async function meshopt() {
  await MeshoptEncoder.ready;
  await MeshoptDecoder.ready;
  const file = new File();
  file.json.extensionsUsed = ['EXT_meshopt_compression', 'KHR_meshopt_compression', 'KHR_mesh_quantization'];
  file.json.extensionsRequired = file.json.extensionsUsed;
  const fallback = file.push('buffers', { byteLength: 0, extensions: { EXT_meshopt_compression: { fallback: true } } });
  // Add views of the packed and of the plain data.
  const twins = (source, count, byteStride, mode, version, filter) => {
    const name = version === 1 ? 'KHR_meshopt_compression' : 'EXT_meshopt_compression';
    const data = MeshoptEncoder.encodeGltfBuffer(new Uint8Array(source.buffer), count, byteStride, mode, version);
    const plain = new Uint8Array(count * byteStride);
    MeshoptDecoder.decodeGltfBuffer(plain, count, byteStride, data, mode, filter);
    const stride = mode === 'ATTRIBUTES' ? { byteStride } : {};
    const extension = { buffer: 0, ...file.bytes(data), byteStride, mode, count, ...(filter && { filter }) };
    const buffer = file.json.buffers[fallback];
    const packed = file.push('bufferViews', {
      buffer: fallback, byteOffset: buffer.byteLength, byteLength: plain.length, ...stride, extensions: { [name]: extension },
    });
    buffer.byteLength += plain.length;
    return [packed, file.view(plain, stride)];
  };
  for (const version of [0, 1]) {
    const g = grid(6, 4), n = g.position.length / 3, bounds = { min: [0, 0, -1], max: [1, 1, 1] };
    const padded = new Int16Array(4 * n);
    for (let i = 0; i < n; i++) for (let c = 0; c < 3; c++) padded[4 * i + c] = 32767 * g.position[3 * i + c];
    const whole = twins(new Float32Array(g.position), n, 12, 'ATTRIBUTES', version);
    const short = twins(padded, n, 8, 'ATTRIBUTES', version);
    const exponents = MeshoptEncoder.encodeFilterExp(new Float32Array(g.position), n, 12, 15);
    const rough = twins(exponents, n, 12, 'ATTRIBUTES', version, 'EXPONENTIAL');
    const normal = twins(MeshoptEncoder.encodeFilterOct(new Float32Array(g.normal), n, 8, 12), n, 8, 'ATTRIBUTES', version, 'OCTAHEDRAL');
    const byte = twins(MeshoptEncoder.encodeFilterOct(new Float32Array(g.normal), n, 4, 8), n, 4, 'ATTRIBUTES', version, 'OCTAHEDRAL');
    const color = version === 1
      ? twins(MeshoptEncoder.encodeFilterColor(new Float32Array(g.color.map((c) => c / 255)), n, 4, 8), n, 4, 'ATTRIBUTES', 1, 'COLOR')
      : twins(new Uint8Array(g.color), n, 4, 'ATTRIBUTES', 0);
    const triangles = twins(new Uint16Array(g.indices), g.indices.length, 2, 'TRIANGLES', version);
    const sequence = twins(new Uint32Array(g.indices), g.indices.length, 4, 'INDICES', version);
    for (const twin of [0, 1]) {
      const name = ['packed', 'plain'][twin];
      const short3 = (view) => file.accessor(view, 5122, 'VEC3', n, { normalized: true, ...bounds });
      const normal3 = (view, type) => file.accessor(view, type, 'VEC3', n, { normalized: true });
      const float3 = (view) => file.accessor(view, 5126, 'VEC3', n, bounds);
      const count = g.indices.length;
      const color4 = file.accessor(color[twin], 5121, 'VEC4', n, { normalized: true });
      file.mesh(`floats ${version} ${name}`, {
        attributes: { POSITION: float3(whole[twin]), NORMAL: normal3(normal[twin], 5122), COLOR_0: color4 },
        indices: file.accessor(triangles[twin], 5123, 'SCALAR', count),
      });
      file.mesh(`shorts ${version} ${name}`, {
        attributes: { POSITION: short3(short[twin]), NORMAL: normal3(byte[twin], 5120) },
        indices: file.accessor(sequence[twin], 5125, 'SCALAR', count),
      });
      file.mesh(`exponents ${version} ${name}`, { attributes: { POSITION: float3(rough[twin]) } });
    }
    // Animate the rotations of two nodes.
    const turns = [];
    for (let i = 0; i < 5; i++) {
      const q = [Math.sin(i), Math.cos(2 * i), 0.3 * i, 0.5], l = Math.hypot(...q);
      turns.push(...q.map((c) => c / l));
    }
    const turn = twins(MeshoptEncoder.encodeFilterQuat(new Float32Array(turns), 5, 8, 14), 5, 8, 'ATTRIBUTES', version, 'QUATERNION');
    const input = file.accessor(file.view(new Float32Array([0, 1, 2, 3, 4])), 5126, 'SCALAR', 5, { min: [0], max: [4] });
    file.json.animations ??= [{ channels: [], samplers: [] }];
    const [animation] = file.json.animations;
    for (const twin of [0, 1]) {
      const node = file.push('nodes', { name: `turn ${version} ${['packed', 'plain'][twin]}` });
      file.json.scenes[0].nodes.push(node);
      const output = file.accessor(turn[twin], 5122, 'VEC4', 5, { normalized: true });
      const sampler = animation.samplers.push({ input, output }) - 1;
      animation.channels.push({ sampler, target: { node, path: 'rotation' } });
    }
  }
  file.write('meshopt.glb');
}

async function draco() {
  const E = await draco3d.createEncoderModule(), D = await draco3d.createDecoderModule();
  const file = new File();
  file.json.extensionsUsed = file.json.extensionsRequired = ['KHR_draco_mesh_compression'];
  const joints = [0, 1, 2].map((x) => file.push('nodes', { translation: [x, 0, 0] }));
  file.json.scenes[0].nodes.push(...joints);
  const skin = file.push('skins', { joints });
  for (const [name, method, speed, bits, w, h, extra] of [
    ['edgebreaker', 'MESH_EDGEBREAKER_ENCODING', 5, 14, 8, 6, []],
    ['valence', 'MESH_EDGEBREAKER_ENCODING', 0, 11, 8, 6, []],
    ['sequential', 'MESH_SEQUENTIAL_ENCODING', 10, 0, 5, 4, []],
    ['degenerate', 'MESH_EDGEBREAKER_ENCODING', 7, 8, 5, 4, [0, 0, 1, 3, 3, 3]],
  ]) {
    const g = grid(w, h), n = g.position.length / 3, indices = [...g.indices, ...extra];
    const encoder = new E.Encoder(), builder = new E.MeshBuilder(), mesh = new E.Mesh();
    builder.AddFacesToMesh(mesh, indices.length / 3, new Uint32Array(indices));
    const normals = g.normal.filter((_, i) => i % 4 < 3);
    const ids = {
      POSITION: builder.AddFloatAttribute(mesh, E.POSITION, n, 3, new Float32Array(g.position)),
      NORMAL: builder.AddFloatAttribute(mesh, E.NORMAL, n, 3, new Float32Array(normals)),
      COLOR_0: builder.AddUInt8Attribute(mesh, E.COLOR, n, 4, new Uint8Array(g.color)),
      JOINTS_0: builder.AddUInt16Attribute(mesh, E.GENERIC, n, 4, new Uint16Array(g.joints)),
      WEIGHTS_0: builder.AddFloatAttribute(mesh, E.GENERIC, n, 4, new Float32Array(g.weights)),
    };
    encoder.SetSpeedOptions(speed, speed);
    encoder.SetEncodingMethod(E[method]);
    if (bits) for (const kind of ['POSITION', 'NORMAL', 'GENERIC']) encoder.SetAttributeQuantization(E[kind], bits);
    const array = new E.DracoInt8Array(), size = encoder.EncodeMeshToDracoBuffer(mesh, array);
    const data = new Uint8Array(size).map((_, i) => array.GetValue(i));

    // Unpack the plain twin with Draco's own decoder.
    const decoder = new D.Decoder(), out = new D.Mesh();
    decoder.DecodeArrayToMesh(data, size, out);
    const faces = out.num_faces(), points = out.num_points(), at = D._malloc(12 * faces);
    decoder.GetTrianglesUInt32Array(out, 12 * faces, at);
    const plainIndices = new Uint32Array(D.HEAPU8.buffer, at, 3 * faces).slice();
    const types = { POSITION: [5126, 'VEC3', 4], NORMAL: [5126, 'VEC3', 4], COLOR_0: [5121, 'VEC4', 1], JOINTS_0: [5123, 'VEC4', 2], WEIGHTS_0: [5126, 'VEC4', 4] };
    const plain = { attributes: {} }, packed = { attributes: {} };
    for (const [key, id] of Object.entries(ids)) {
      const [componentType, type, bytes] = types[key];
      const attribute = decoder.GetAttributeByUniqueId(out, id), length = points * bytes * attribute.num_components();
      const where = D._malloc(length);
      decoder.GetAttributeDataArrayForAllPoints(out, attribute, attribute.data_type(), length, where);
      const more = { ...(key === 'COLOR_0' && { normalized: true }), ...(key === 'POSITION' && { min: [0, 0, -1], max: [1, 1, 1] }) };
      plain.attributes[key] = file.accessor(file.view(D.HEAPU8.slice(where, where + length)), componentType, type, points, more);
      packed.attributes[key] = file.push('accessors', { componentType, type, count: points, ...more });
    }
    plain.indices = file.accessor(file.view(plainIndices), 5125, 'SCALAR', 3 * faces);
    packed.indices = file.push('accessors', { componentType: 5125, type: 'SCALAR', count: 3 * faces });
    packed.extensions = { KHR_draco_mesh_compression: { bufferView: file.view(data), attributes: ids } };
    file.mesh(`${name} packed`, packed, { skin });
    file.mesh(`${name} plain`, plain, { skin });
  }
  file.write('draco.glb');
}

async function images() {
  const require = createRequire(import.meta.url);
  const folder = path.dirname(require.resolve('three/examples/jsm/libs/basis/basis_transcoder.js'));
  const code = fs.readFileSync(`${folder}/basis_transcoder.js`, 'utf8');
  const basis = await new Function('require', '__dirname', `${code};return BASIS;`)(require, folder)({
    wasmBinary: fs.readFileSync(`${folder}/basis_transcoder.wasm`),
  });
  basis.initializeBasis();
  const [width, height] = [20, 12], raw = Buffer.alloc(4 * width * height);
  for (let y = 0; y < height; y++) for (let x = 0; x < width; x++) {
    raw.set([(255 * x) / width, (255 * y) / height, 128 + 100 * Math.sin(x), x < 10 ? 255 : 25 * (x - 9)], 4 * (y * width + x));
  }
  const picture = () => sharp(raw, { raw: { width, height, channels: 4 } });
  const png = await picture().png().toBuffer();
  const imageDecoder = async () => ({ data: new Uint8Array(raw), width, height });
  const file = new File();
  file.json.extensionsUsed = file.json.extensionsRequired = ['KHR_texture_basisu', 'EXT_texture_webp'];
  const position = file.accessor(file.view(new Float32Array([0, 0, 0, 1, 0, 0, 0, 1, 0])), 5126, 'VEC3', 3, { min: [0, 0, 0], max: [1, 1, 0] });
  const uv = file.accessor(file.view(new Float32Array([0, 0, 1, 0, 0, 1])), 5126, 'VEC2', 3);
  const add = (name, data, mimeType, extension) => {
    const image = file.push('images', { bufferView: file.view(new Uint8Array(data)), mimeType });
    const texture = file.push('textures', extension ? { extensions: { [extension]: { source: image } } } : { source: image });
    const material = file.push('materials', { name, pbrMetallicRoughness: { baseColorTexture: { index: texture } } });
    file.mesh(name, { attributes: { POSITION: position, TEXCOORD_0: uv }, material });
  };
  const twins = async (name, data, mimeType, extension, plain) => {
    add(`${name} packed`, data, mimeType, extension);
    add(`${name} plain`, await sharp(plain, { raw: { width, height, channels: 4 } }).png().toBuffer(), 'image/png');
  };
  for (const [name, options] of [
    ['etc1s', { isUASTC: false }],
    ['uastc', { isUASTC: true }],
    ['zstd', { isUASTC: true, needSupercompression: true, generateMipmap: true }],
  ]) {
    const data = await encodeToKTX2(png, { ...options, imageDecoder });
    const image = new basis.KTX2File(new Uint8Array(data));
    image.startTranscoding();
    const RGBA32 = 13, texels = new Uint8Array(image.getImageTranscodedSizeInBytes(0, 0, 0, RGBA32));
    image.transcodeImage(texels, 0, 0, 0, RGBA32, 0, -1, -1);
    await twins(name, data, 'image/ktx2', 'KHR_texture_basisu', Buffer.from(texels));
  }
  for (const [name, options] of [['lossy', { quality: 60 }], ['lossless', { lossless: true, exact: true }]]) {
    const data = await picture().webp(options).toBuffer();
    await twins(name, data, 'image/webp', 'EXT_texture_webp', await sharp(data).ensureAlpha().raw().toBuffer());
  }
  file.write('images.glb');
}

await meshopt();
await draco();
await images();
