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

// Draws the scene with a WebGL 2 context.
class Renderer {
  constructor(gl, blocks) {
    this.gl = gl;
    this.anisotropic = gl.getExtension("EXT_texture_filter_anisotropic");
    this.largest = gl.getParameter(gl.MAX_TEXTURE_SIZE);
    if (Math.max(scene.light.width, scene.light.height) > this.largest) {
      throw new Error(`The light has ${scene.light.width}×${scene.light.height} texels, but this device supports ${this.largest}. Bake fewer --texels.`);
    }
    this.surface = this.program("surface");
    this.sky = this.program("sky");
    this.screen = this.program("screen");
    this.target = null;
    this.upload(blocks);
  }

  program(name) {
    const gl = this.gl;
    const program = gl.createProgram();
    const head = "#version 300 es\nprecision highp float;\nprecision highp int;\nprecision highp sampler2D;\n";
    for (const [stage, kind] of [["vertex", gl.VERTEX_SHADER], ["fragment", gl.FRAGMENT_SHADER]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, head + element(`${name}-${stage}`).textContent);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost()) {
        throw new Error(`The ${name} shader failed: ${gl.getShaderInfoLog(shader)}`);
      }
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
      throw new Error(`The ${name} shader failed: ${gl.getProgramInfoLog(program)}`);
    }
    const places = {};
    for (let k = 0; k < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); k++) {
      const { name } = gl.getActiveUniform(program, k);
      places[name] = gl.getUniformLocation(program, name);
    }
    return { program, places };
  }

  // Creates a texture of exact texels, in rows of `width` texels.
  texels(width, height, data, [inner, outer, type]) {
    const gl = this.gl;
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    gl.texImage2D(gl.TEXTURE_2D, 0, inner, width, height, 0, outer, type, data);
    return texture;
  }

  // Creates the texture of a page of coats: whole rows of coefficients, as wide as needed.
  page(bytes, halves, coefficients) {
    const gl = this.gl;
    const data = halves ? new Uint16Array(bytes.buffer) : new Uint32Array(bytes.buffer);
    const channels = halves ? 3 : 1;
    const count = Math.max(1, data.length / channels);
    const least = Math.max(64, Math.ceil(Math.sqrt(count)));
    const width = Math.min(this.largest, Math.ceil(least / coefficients) * coefficients);
    const height = Math.ceil(count / width);
    if (height > this.largest) throw new Error("The light of coats is too large for this device. Bake fewer --texels.");
    const padded = halves ? new Uint16Array(3 * width * height) : new Uint32Array(width * height);
    padded.set(data);
    const format = halves ? [gl.RGB16F, gl.RGB, gl.HALF_FLOAT] : [gl.RGB9_E5, gl.RGB, gl.UNSIGNED_INT_5_9_9_9_REV];
    return this.texels(width, height, padded, format);
  }

  upload(blocks) {
    const gl = this.gl;
    const { light } = scene;
    const shared = [gl.RGB9_E5, gl.RGB, gl.UNSIGNED_INT_5_9_9_9_REV];
    this.vertices = gl.createVertexArray();
    gl.bindVertexArray(this.vertices);
    const attributes = [["positions", 3, gl.FLOAT], ["normals", 3, gl.SHORT], ["atlas", 2, gl.FLOAT], ["uv0", 2, gl.FLOAT],
      ["uv1", 2, gl.FLOAT], ["uv2", 2, gl.FLOAT], ["colors", 4, gl.UNSIGNED_SHORT]];
    attributes.forEach(([name, size, type], place) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, blocks[name], gl.STATIC_DRAW);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, size, type, type !== gl.FLOAT, 0, 0);
    });
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, blocks.indices, gl.STATIC_DRAW);
    gl.bindVertexArray(null);

    this.hasCoats = blocks.places.length > 0;
    const words = (bytes) => new Uint32Array(bytes.buffer);
    const one = new Uint32Array(1);
    const places = this.hasCoats ? words(blocks.places) : one;
    const [width, height] = this.hasCoats ? [light.width, light.height] : [1, 1];
    this.units = {
      irradianceImage: this.texels(light.width, light.height, words(blocks.irradiance), shared),
      placeImage: this.texels(width, height, places, [gl.R32UI, gl.RED_INTEGER, gl.UNSIGNED_INT]),
      constantPage: this.page(blocks.page0, false, light.coefficients[0]),
      linearPage: this.page(blocks.page1, true, light.coefficients[1]),
      quadraticPage: this.page(blocks.page2, true, light.coefficients[2]),
      octahedralPage: this.page(blocks.page3, false, light.coefficients[3]),
      albedoImage: this.texels(light.steps, light.steps + 1, new Float32Array(blocks.albedos.buffer), [gl.RG32F, gl.RG, gl.FLOAT]),
      skyImage: scene.sky?.width ? this.texels(scene.sky.width, scene.sky.height, words(blocks.sky), shared)
        : this.texels(1, 1, one, shared),
    };
    this.blank = this.texels(1, 1, new Uint8Array([255, 255, 255, 255]), [gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE]);
    this.images = [];
  }

  // Decodes the images of the materials. An image may serve as color and as data, so each use has its own texture.
  async load(blocks) {
    const gl = this.gl;
    const uses = new Map();
    for (const material of scene.materials.list) {
      for (const [name, isColor] of [["baseTexture", true], ["emissionTexture", true], ["roughTexture", false]]) {
        if (material[name]) uses.set(material[name].texture, isColor);
      }
    }
    for (const [texture, isColor] of uses) {
      const { block, kind, wrap, blocky } = scene.materials.textures[texture];
      const options = { premultiplyAlpha: "none", colorSpaceConversion: "none" };
      const image = await createImageBitmap(new Blob([blocks[block]], { type: kind }), options);
      gl.activeTexture(gl.TEXTURE0);
      gl.bindTexture(gl.TEXTURE_2D, (this.images[texture] = gl.createTexture()));
      gl.pixelStorei(gl.UNPACK_ALIGNMENT, 4);
      gl.texImage2D(gl.TEXTURE_2D, 0, isColor ? gl.SRGB8_ALPHA8 : gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, image);
      gl.generateMipmap(gl.TEXTURE_2D);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
      if (blocky) gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
      const modes = [gl.REPEAT, gl.MIRRORED_REPEAT, gl.CLAMP_TO_EDGE];
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, modes[wrap[0]]);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, modes[wrap[1]]);
      if (this.anisotropic) {
        const most = gl.getParameter(this.anisotropic.MAX_TEXTURE_MAX_ANISOTROPY_EXT);
        gl.texParameterf(gl.TEXTURE_2D, this.anisotropic.TEXTURE_MAX_ANISOTROPY_EXT, Math.min(12, most));
      }
      image.close();
    }
  }

  // Selects a program, and sets its textures and the uniforms of the tone curve.
  use({ program, places }, gain) {
    const gl = this.gl;
    gl.useProgram(program);
    let unit = 0;
    for (const [name, texture] of Object.entries(this.units)) {
      if (!places[name]) continue;
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.uniform1i(places[name], unit++);
    }
    gl.uniform1f(places.gain, gain);
    gl.uniform1i(places.curveKind, scene.curve.operator);
    gl.uniform1f(places.white, scene.curve.white);
    return unit;
  }

  // Returns buffers of width × height pixels with several samples, and a texture for their means, in linear display light.
  buffers(width, height) {
    const gl = this.gl;
    if (this.target?.width === width && this.target.height === height) return this.target;
    if (this.target) {
      [this.target.many, this.target.single].forEach((one) => gl.deleteFramebuffer(one));
      this.target.stored.forEach((one) => gl.deleteRenderbuffer(one));
      gl.deleteTexture(this.target.texture);
    }
    const samples = Math.min(4, gl.getParameter(gl.MAX_SAMPLES));
    const stored = [gl.SRGB8_ALPHA8, gl.DEPTH_COMPONENT24].map((format) => {
      const buffer = gl.createRenderbuffer();
      gl.bindRenderbuffer(gl.RENDERBUFFER, buffer);
      gl.renderbufferStorageMultisample(gl.RENDERBUFFER, samples, format, width, height);
      return buffer;
    });
    const [many, single] = [gl.createFramebuffer(), gl.createFramebuffer()];
    gl.bindFramebuffer(gl.FRAMEBUFFER, many);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.RENDERBUFFER, stored[0]);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, stored[1]);
    const texture = this.texels(width, height, null, [gl.SRGB8_ALPHA8, gl.RGBA, gl.UNSIGNED_BYTE]);
    gl.bindFramebuffer(gl.FRAMEBUFFER, single);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
    return (this.target = { width, height, stored, many, single, texture });
  }

  // Draws a picture of width × height pixels into a framebuffer: factor × factor times four samples per pixel.
  show(camera, look, { width, height, factor, framebuffer }) {
    const gl = this.gl;
    const [w, h] = [width * factor, height * factor];
    const target = this.buffers(w, h);
    gl.bindFramebuffer(gl.FRAMEBUFFER, target.many);
    this.draw(camera, look, w, h);
    gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, target.single);
    gl.blitFramebuffer(0, 0, w, h, 0, 0, w, h, gl.COLOR_BUFFER_BIT, gl.NEAREST);
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    const { program, places } = this.screen;
    gl.useProgram(program);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, target.texture);
    gl.uniform1i(places.picture, 0);
    gl.uniform1i(places.factor, factor);
    gl.uniform1f(places.gamma, scene.curve.gamma);
    [gl.DEPTH_TEST, gl.CULL_FACE, gl.BLEND].forEach((one) => gl.disable(one));
    gl.viewport(0, 0, width, height);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  // Draws the scene into the bound framebuffer of width × height pixels.
  draw(camera, { gain, coatMode }, width, height) {
    const gl = this.gl;
    const half = camera.half(width / height);
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.disable(gl.BLEND);
    gl.depthMask(true);
    if (scene.sky) this.drawSky(camera, half, gain, [width, height]);

    const unit = this.use(this.surface, gain);
    const { places } = this.surface;
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.enable(gl.CULL_FACE);
    gl.uniformMatrix4fv(places.clipFromWorld, false, camera.clipFromWorld(half));
    gl.uniform3fv(places.eye, camera.eye);
    gl.uniform3fv(places.forward, camera.forward);
    gl.uniform1i(places.parallel, scene.camera.parallel);
    gl.uniform3fv(places.meanLight, scene.light.mean);
    gl.uniform1i(places.coatMode, coatMode);
    gl.uniform1i(places.hasCoats, this.hasCoats);
    gl.uniform1i(places.albedoSteps, scene.light.steps);
    gl.bindVertexArray(this.vertices);
    for (const batch of scene.batches) {
      this.setMaterial(scene.materials.list[batch.material], unit);
      gl.uniform1i(places.litBy, batch.lit);
      if (batch.blended) {
        gl.enable(gl.BLEND);
        gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE);
        gl.depthMask(false);
      }
      gl.drawElements(gl.TRIANGLES, batch.count, gl.UNSIGNED_INT, 4 * batch.first);
    }
    gl.bindVertexArray(null);
    gl.depthMask(true);
  }

  drawSky(camera, half, gain, size) {
    const gl = this.gl;
    const { places } = this.sky;
    this.use(this.sky, gain);
    gl.disable(gl.DEPTH_TEST);
    gl.disable(gl.CULL_FACE);
    const spread = scene.camera.parallel ? 0 : 1;
    gl.uniform3fv(places.ahead, camera.forward);
    gl.uniform3fv(places.right, scaled(camera.right, spread * half[0]));
    gl.uniform3fv(places.up, scaled(camera.up, spread * half[1]));
    gl.uniform2fv(places.pictureSize, size);
    const colors = scene.sky.gradient;
    gl.uniform1i(places.isGradient, Boolean(colors));
    if (colors) ["zenith", "horizon", "ground"].forEach((name, k) => gl.uniform3fv(places[name], colors[k]));
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  setMaterial(material, unit) {
    const gl = this.gl;
    const { places } = this.surface;
    gl.uniform3fv(places.baseColor, material.base);
    gl.uniform1f(places.opacityFactor, material.opacity);
    gl.uniform1i(places.alphaMode, material.alpha);
    gl.uniform1f(places.cutoff, material.cutoff);
    gl.uniform1f(places.metallicFactor, material.metallic);
    gl.uniform1f(places.roughnessFactor, material.roughness);
    gl.uniform3fv(places.dielectric, material.f0);
    gl.uniform3fv(places.emission, material.emission);
    gl.uniform1i(places.mayHaveCoat, material.coat);
    for (const [name, image, set] of [["baseTexture", "baseImage", "baseSet"], ["roughTexture", "roughImage", "roughSet"],
      ["emissionTexture", "emissionImage", "emissionSet"]]) {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, this.images[material[name]?.texture] ?? this.blank);
      gl.uniform1i(places[image], unit++);
      gl.uniform1i(places[set], material[name]?.set ?? -1);
    }
  }

  // Returns a picture as { width, height, data }, RGBA in rows from the top.
  still(camera, look, width, height) {
    const gl = this.gl;
    const factor = Math.max(width, height) * 2 <= Math.min(this.largest, gl.getParameter(gl.MAX_RENDERBUFFER_SIZE)) ? 2 : 1;
    const [buffer, framebuffer] = [gl.createRenderbuffer(), gl.createFramebuffer()];
    gl.bindRenderbuffer(gl.RENDERBUFFER, buffer);
    gl.renderbufferStorage(gl.RENDERBUFFER, gl.RGBA8, width, height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.RENDERBUFFER, buffer);
    this.show(camera, look, { width, height, factor, framebuffer });
    const pixels = new Uint8ClampedArray(4 * width * height);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.deleteFramebuffer(framebuffer);
    gl.deleteRenderbuffer(buffer);
    // Rows of WebGL start at the bottom.
    const data = new Uint8ClampedArray(pixels.length);
    for (let y = 0; y < height; y++) data.set(pixels.subarray(4 * width * y, 4 * width * (y + 1)), 4 * width * (height - 1 - y));
    return { width, height, data };
  }
}

// Camera with a position and three unit axes. It starts as the camera of the film.
class Camera {
  constructor() {
    this.reset();
  }

  reset() {
    const { eye, forward, up } = scene.camera;
    const { center } = scene.bounds;
    [this.eye, this.forward, this.up] = [eye, normalized(forward), normalized(up)];
    this.right = normalized(cross(this.forward, this.up));
    // Orbit around a point ahead, at the distance of the scene's center.
    const way = dot(add(center, this.eye, -1), this.forward);
    this.distance = Math.max(way, 0.1 * scene.bounds.radius);
  }

  // Half the width and height of the picture at a distance of 1, or in meters for parallel rays.
  half(aspect) {
    const { halfWidth, halfHeight } = scene.camera;
    const height = Math.max(halfHeight, halfWidth / aspect);
    return [height * aspect, height];
  }

  clipFromWorld([x, y]) {
    const { radius, center } = scene.bounds;
    const r = this.right, u = this.up, f = this.forward, e = this.eye;
    const way = Math.hypot(...add(center, e, -1)) + radius;
    const near = Math.max(scene.camera.near, 5e-4 * Math.min(radius, 100));
    const far = Math.max(scene.camera.far > 0 ? Math.min(scene.camera.far, 1.1 * way) : 1.1 * way, 2 * near);
    const position = [-dot(r, e), -dot(u, e), dot(f, e)];
    const row = (axis, last, scale) => [axis[0] * scale, axis[1] * scale, axis[2] * scale, last * scale];
    const X = row(r, position[0], 1 / x), Y = row(u, position[1], 1 / y);
    const back = [-f[0], -f[1], -f[2], position[2]];
    const [a, b] = scene.camera.parallel ? [-2 / (far - near), -(far + near) / (far - near)]
      : [-(far + near) / (far - near), (-2 * far * near) / (far - near)];
    const Z = back.map((value, k) => a * value + (k === 3 ? b : 0));
    const W = scene.camera.parallel ? [0, 0, 0, 1] : back.map((value) => -value);
    return new Float32Array([0, 1, 2, 3].flatMap((k) => [X[k], Y[k], Z[k], W[k]]));
  }

  // Turns by two angles: about the vertical axis, and up. Horizons become level.
  turn(yaw, pitch) {
    const f = this.forward;
    const height = Math.asin(Math.max(-1, Math.min(1, f[1]))) + pitch;
    const angle = Math.atan2(f[0], -f[2]) - yaw;
    const limited = Math.max(-1.55, Math.min(1.55, height));
    this.forward = [Math.cos(limited) * Math.sin(angle), Math.sin(limited), -Math.cos(limited) * Math.cos(angle)];
    this.right = normalized(cross(this.forward, [0, 1, 0]));
    this.up = cross(this.right, this.forward);
  }

  orbit(yaw, pitch) {
    const pivot = add(this.eye, this.forward, this.distance);
    this.turn(yaw, pitch);
    this.eye = add(pivot, this.forward, -this.distance);
  }

  // Moves along the three axes [m]. Orbits approach their pivot.
  move(right, up, forward) {
    this.eye = add(add(add(this.eye, this.right, right), this.up, up), this.forward, forward);
    this.distance = Math.max(this.distance - forward, 0.02 * scene.bounds.radius);
  }
}

// Connects the renderer with the controls of the page.
function start(renderer) {
  const gl = renderer.gl;
  const camera = new Camera();
  const look = { gain: 1, coatMode: 0 };
  const keys = new Set();
  const pointers = new Map();
  let [isDirty, isTurning, before, times] = [true, false, 0, []];
  // Draw the first frames several times, for up to a second, to measure them.
  let [trials, begin] = [12, performance.now()];
  const { radius, low, high } = scene.bounds;
  const isInside = scene.camera.eye.every((part, k) => part > low[k] && part < high[k]);
  element("panel").open = innerWidth >= 640;
  element("mode").value = isInside ? "walk" : "orbit";
  element("coats").hidden = !renderer.hasCoats && !scene.materials.list.some((material) => material.coat);
  const touch = (change) => {
    change();
    isDirty = true;
  };

  element("exposure").addEventListener("input", (event) => touch(() => {
    const stops = Number(event.target.value);
    look.gain = 2 ** stops;
    element("stops").textContent = `${stops > 0 ? "+" : ""}${stops} stops`;
  }));
  element("coat").addEventListener("change", (event) => touch(() => (look.coatMode = Number(event.target.value))));
  element("start").addEventListener("click", () => touch(() => camera.reset()));
  element("turn").addEventListener("click", (event) => touch(() => {
    isTurning = !isTurning;
    event.target.setAttribute("aria-pressed", isTurning);
  }));

  // Keys move the camera while they are down. Buttons act as keys.
  const moves = { KeyW: [0, 0, 1], ArrowUp: [0, 0, 1], KeyS: [0, 0, -1], ArrowDown: [0, 0, -1], KeyA: [-1, 0, 0],
    ArrowLeft: [-1, 0, 0], KeyD: [1, 0, 0], ArrowRight: [1, 0, 0], KeyE: [0, 1, 0], KeyQ: [0, -1, 0] };
  addEventListener("keydown", (event) => {
    const isControl = ["INPUT", "SELECT"].includes(event.target.tagName);
    if (!isControl && moves[event.code] && !event.ctrlKey && !event.metaKey && !event.altKey) {
      keys.add(event.code);
      event.preventDefault();
    }
  });
  addEventListener("keyup", (event) => keys.delete(event.code));
  addEventListener("blur", () => keys.clear());
  for (const button of document.querySelectorAll("[data-key]")) {
    const key = button.dataset.key;
    button.addEventListener("pointerdown", () => keys.add(key));
    for (const end of ["pointerup", "pointerleave", "pointercancel"]) button.addEventListener(end, () => keys.delete(key));
    // A click without a pointer comes from the keyboard, and moves by one step.
    button.addEventListener("click", (event) => {
      if (event.detail === 0) touch(() => camera.move(...scaled(moves[key], 0.03 * radius)));
    });
  }

  // One pointer looks or orbits, two pointers pinch.
  const spread = () => {
    const [a, b] = [...pointers.values()];
    return Math.hypot(a[0] - b[0], a[1] - b[1]);
  };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    canvas.focus({ preventScroll: true });
    pointers.set(event.pointerId, [event.clientX, event.clientY]);
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => pointers.delete(event.pointerId));
  canvas.addEventListener("pointermove", (event) => {
    const last = pointers.get(event.pointerId);
    if (!last) return;
    const wide = pointers.size === 2 ? spread() : 0;
    pointers.set(event.pointerId, [event.clientX, event.clientY]);
    touch(() => {
      if (pointers.size === 2) {
        camera.move(0, 0, (spread() - wide) * 0.004 * camera.distance);
      } else if (pointers.size === 1) {
        const angles = [(event.clientX - last[0]) * 0.005, (event.clientY - last[1]) * 0.005];
        if (element("mode").value === "orbit") camera.orbit(...angles);
        else camera.turn(...angles);
      }
    });
  });
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    const pixels = event.deltaY * (event.deltaMode === 1 ? 20 : 1);
    touch(() => camera.move(0, 0, -Math.max(-200, Math.min(200, pixels)) * 0.001 * camera.distance));
  }, { passive: false });

  // Draws a frame if anything changed, and shows the time of consecutive frames.
  const frame = (now) => {
    const seconds = Math.min((now - before) / 1000, 0.1);
    for (const key of keys) touch(() => camera.move(...scaled(moves[key], 0.4 * radius * seconds)));
    if (isTurning) touch(() => (element("mode").value === "orbit" ? camera.orbit(0.3 * seconds, 0) : camera.turn(0.3 * seconds, 0)));
    const ratio = Math.min(devicePixelRatio || 1, 2);
    const size = [Math.round(canvas.clientWidth * ratio), Math.round(canvas.clientHeight * ratio)];
    if (canvas.width !== size[0] || canvas.height !== size[1]) touch(() => ([canvas.width, canvas.height] = size));
    if (isDirty && size[0] > 0 && size[1] > 0) {
      isDirty = --trials > 0 && now - begin < 1000;
      renderer.show(camera, look, { width: size[0], height: size[1], factor: 1, framebuffer: null });
      if (now - before < 5000) times.push(now - before);
      times = times.slice(-20);
      const mean = times.reduce((sum, time) => sum + time, 0) / times.length;
      if (times.length > 1) element("speed").textContent = `${mean.toFixed(1)} ms · ${(1000 / mean).toFixed(0)} frames/s`;
    } else {
      times = [];
    }
    before = now;
    requestAnimationFrame(frame);
  };
  requestAnimationFrame(frame);

  // Functions for tests: a picture of the current view, and the mean time of frames including their completion [ms].
  window.renderStill = (width, height) => {
    isDirty = true;
    return renderer.still(camera, look, width, height);
  };
  window.measureFrames = (count, width, height) => {
    [canvas.width, canvas.height] = [width, height];
    const pixel = new Uint8Array(4);
    const complete = () => gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
    const show = () => renderer.show(camera, look, { width, height, factor: 1, framebuffer: null });
    show();
    complete();
    const begin = performance.now();
    for (let k = 0; k < count; k++) {
      camera.turn(0.01, 0);
      show();
      complete();
    }
    isDirty = true;
    return (performance.now() - begin) / count;
  };
  window.setCoats = (mode) => (look.coatMode = mode);
}

async function main() {
  message.textContent = "Loading the scene …";
  message.hidden = false;
  const gl = canvas.getContext("webgl2", { antialias: false, depth: false, alpha: false, powerPreference: "high-performance" });
  if (!gl) return fail("This page needs WebGL 2, which this browser does not offer. Another browser, or hardware acceleration in the settings, may help.");
  if (!window.DecompressionStream) return fail("This browser is too old for this page: it has no DecompressionStream.");
  canvas.addEventListener("webglcontextlost", () => fail("The graphics device was lost. Reload the page."));
  try {
    const blocks = await decoded();
    const renderer = new Renderer(gl, blocks);
    await renderer.load(blocks);
    start(renderer);
    message.hidden = true;
    window.isReady = true;
  } catch (error) {
    fail(`The scene cannot be shown: ${error.message}`);
  }
}
main();
