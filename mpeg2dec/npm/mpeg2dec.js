// MPEG-1 and MPEG-2 video in web pages: a decoder (WebAssembly), a renderer (WebGL or 2D) and a player (worker).
const PIECE = 1 << 15; // bytes decoded at once
const AHEAD = 16; // decoded pictures that wait for display

/** Decoder of elementary, program and transport streams. */
export class Decoder {
  /** Loads the module from a URL, or from its bytes. */
  static async create(source = new URL("mpeg2dec.wasm", import.meta.url)) {
    const bytes = source.byteLength ? source : await (await fetch(source)).arrayBuffer();
    return new Decoder((await WebAssembly.instantiate(bytes, {})).instance.exports);
  }
  constructor(module) {
    this.module = module;
    this.reset();
  }
  /** Starts a new stream. Pictures with missing references are shown if `showIncomplete`. */
  reset(showIncomplete = false) {
    this.module.reset(showIncomplete ? 1 : 0);
  }
  /** Decodes a Uint8Array and yields the complete pictures. */
  *decode(bytes) {
    for (let i = 0; i < bytes.length; i += PIECE) {
      const piece = bytes.subarray(i, i + PIECE);
      const address = this.module.input(piece.length);
      new Uint8Array(this.module.memory.buffer, address, piece.length).set(piece);
      this.module.push(piece.length);
      yield* this.pictures();
    }
  }
  /** Ends the stream and yields the remaining pictures. */
  *flush() {
    this.module.flush();
    yield* this.pictures();
  }
  *pictures() {
    while (this.module.next()) yield this.picture();
  }
  /** Copies the current picture: planes y, cb and cr without gaps, and its properties. */
  picture() {
    const m = this.module;
    const sizes = [0, 1, 2].map((i) => [m.width(i), m.height(i)]);
    const data = new Uint8Array(sizes.reduce((sum, [w, h]) => sum + w * h, 0));
    let end = 0;
    const planes = sizes.map(([w, h], i) => {
      const [start, from, stride] = [end, m.plane(i), m.stride(i)];
      const samples = new Uint8Array(m.memory.buffer, from, stride * h);
      for (let y = 0; y < h; y++, end += w) data.set(samples.subarray(y * stride, y * stride + w), end);
      return data.subarray(start, end);
    });
    const flags = m.flags();
    const [[width, height], [chromaWidth, chromaHeight]] = sizes;
    return {
      y: planes[0], cb: planes[1], cr: planes[2], width, height, chromaWidth, chromaHeight,
      time: m.time(), frameRate: m.frame_rate(), sampleAspect: m.sample_aspect(), concealed: m.concealed(),
      topFieldFirst: (flags & 1) > 0, repeatFirstField: (flags & 2) > 0, progressive: (flags & 4) > 0,
      type: " IPB"[(flags >> 4) & 3], matrix: (flags >> 8) & 255,
    };
  }
}

// Luma and chroma weights of ITU-R BT.601 and BT.709, for samples of 16 to 235.
function weights(picture) {
  const is709 = picture.matrix === 1 || (picture.matrix === 2 && picture.width >= 1280);
  return is709 ? [1.1644, 1.7927, 0.2132, 0.5329, 2.1124] : [1.1644, 1.596, 0.3918, 0.813, 2.0172];
}

const VERTEX = `attribute vec2 corner; varying vec2 at;
void main() { at = vec2(corner.x, 1.0 - corner.y); gl_Position = vec4(2.0 * corner - 1.0, 0.0, 1.0); }`;
const FRAGMENT = `precision highp float; varying vec2 at;
uniform sampler2D y, cb, cr; uniform float field, yHeight, cHeight; uniform float w[5];
float sample(sampler2D plane, float height) {
  if (field < 0.0) return texture2D(plane, at).r;
  float line = (at.y * height - 0.5 - field) / 2.0; // between two lines of one field
  vec2 rows = (2.0 * vec2(floor(line), floor(line) + 1.0) + field + 0.5) / height;
  return mix(texture2D(plane, vec2(at.x, rows.x)).r, texture2D(plane, vec2(at.x, rows.y)).r, fract(line));
}
void main() {
  float l = w[0] * (sample(y, yHeight) - 0.0627), b = sample(cb, cHeight) - 0.502, r = sample(cr, cHeight) - 0.502;
  gl_FragColor = vec4(l + w[1] * r, l - w[2] * b - w[3] * r, l + w[4] * b, 1.0);
}`;

/** Draws pictures in a canvas by WebGL, or by its 2D context. */
export class Renderer {
  constructor(canvas, { webgl = true } = {}) {
    this.canvas = canvas;
    this.gl = webgl ? canvas.getContext("webgl", { alpha: false, preserveDrawingBuffer: true }) : null;
    this.gl ? this.prepare(this.gl) : (this.context = canvas.getContext("2d"));
  }
  prepare(gl) {
    const program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.bindAttribLocation(program, 0, "corner");
    gl.linkProgram(program);
    gl.useProgram(program);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([0, 0, 1, 0, 0, 1, 1, 1]), gl.STATIC_DRAW);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 2, gl.FLOAT, false, 0, 0);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    this.uniform = (name) => gl.getUniformLocation(program, name);
    ["y", "cb", "cr"].forEach((name, i) => {
      gl.activeTexture(gl.TEXTURE0 + i);
      gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
      const set = (name, value) => gl.texParameteri(gl.TEXTURE_2D, gl["TEXTURE_" + name], value);
      ["WRAP_S", "WRAP_T"].forEach((name) => set(name, gl.CLAMP_TO_EDGE));
      ["MIN_FILTER", "MAG_FILTER"].forEach((name) => set(name, gl.LINEAR));
      gl.uniform1i(this.uniform(name), i);
    });
  }
  /** Draws a picture, or the lines of one field: 0 for the top field, 1 for the bottom field. */
  draw(picture, field = -1) {
    const { canvas, gl } = this;
    if (canvas.width !== picture.width || canvas.height !== picture.height) {
      [canvas.width, canvas.height] = [picture.width, picture.height];
      canvas.style.aspectRatio = `${picture.width * picture.sampleAspect} / ${picture.height}`;
    }
    if (!gl) return this.drawPixels(picture, field);
    gl.viewport(0, 0, canvas.width, canvas.height);
    ["y", "cb", "cr"].forEach((name, i) => {
      const [w, h] = i ? [picture.chromaWidth, picture.chromaHeight] : [picture.width, picture.height];
      gl.activeTexture(gl.TEXTURE0 + i);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.LUMINANCE, w, h, 0, gl.LUMINANCE, gl.UNSIGNED_BYTE, picture[name]);
    });
    gl.uniform1f(this.uniform("field"), field);
    gl.uniform1f(this.uniform("yHeight"), picture.height);
    gl.uniform1f(this.uniform("cHeight"), picture.chromaHeight);
    gl.uniform1fv(this.uniform("w"), weights(picture));
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
  }
  drawPixels(picture, field) {
    const { width, height, chromaWidth, chromaHeight, y, cb, cr } = picture;
    const [luma, rCr, gCb, gCr, bCb] = weights(picture);
    const [shiftX, shiftY] = [chromaWidth < width ? 1 : 0, chromaHeight < height ? 1 : 0];
    const image = this.context.createImageData(width, height);
    const line = (row, rows) => (field < 0 ? row : Math.min((row & ~1) | field, rows - 1));
    for (let row = 0, out = 0; row < height; row++) {
      const [from, chroma] = [line(row, height) * width, line(row >> shiftY, chromaHeight) * chromaWidth];
      for (let x = 0; x < width; x++, out += 4) {
        const l = luma * (y[from + x] - 16);
        const [b, r] = [cb[chroma + (x >> shiftX)] - 128, cr[chroma + (x >> shiftX)] - 128];
        image.data[out] = l + rCr * r;
        image.data[out + 1] = l - gCb * b - gCr * r;
        image.data[out + 2] = l + bCb * b;
        image.data[out + 3] = 255;
      }
    }
    this.context.putImageData(image, 0, 0);
  }
}

/** Plays a stream in a canvas. The stream is decoded in a worker, and interlaced pictures are shown field by field. */
export class Player {
  constructor(canvas, options = {}) {
    this.renderer = new Renderer(canvas, options);
    this.deinterlace = options.deinterlace ?? true;
    this.worker = new Worker(import.meta.url, { type: "module", name: "mpeg2dec" });
    this.worker.onmessage = ({ data }) => (data ? this.queue.push(data) : this.decoded());
    [this.queue, this.clock, this.last] = [[], 0, null];
    requestAnimationFrame((now) => this.tick(now));
  }
  /** Fetches a stream and plays it while it arrives. */
  async load(address) {
    const reader = (await fetch(address)).body.getReader();
    for (let { done, value } = await reader.read(); !done; { done, value } = await reader.read()) await this.push(value);
    await this.push(null);
  }
  /** Decodes bytes, or ends the stream with `null`. Resolves when few enough pictures wait for display. */
  async push(bytes) {
    await new Promise((resolve) => [(this.decoded = resolve), this.worker.postMessage(bytes)]);
    while (this.queue.length > AHEAD) await new Promise((resolve) => setTimeout(resolve, 20));
  }
  /** Shows a picture, or its second field, when it is due. */
  tick(now) {
    if (this.second && now >= this.second.due) [this.second] = [this.renderer.draw(this.last, this.second.field)];
    if (this.queue.length && now >= this.clock) {
      const picture = (this.last = this.queue.shift());
      const period = (1000 / picture.frameRate) * (picture.repeatFirstField ? 1.5 : 1);
      const first = this.deinterlace && !picture.progressive ? (picture.topFieldFirst ? 0 : 1) : -1;
      this.renderer.draw(picture, first);
      this.second = first < 0 ? null : { field: 1 - first, due: now + period / 2 };
      this.clock = Math.max(this.clock + period, now - period); // no hurry after a gap
    }
    requestAnimationFrame((time) => this.tick(time));
  }
}

// In a worker this module decodes the messages of a player.
if (typeof WorkerGlobalScope !== "undefined" && self.name === "mpeg2dec") {
  const loading = Decoder.create();
  self.onmessage = async ({ data }) => {
    const decoder = await loading;
    for (const picture of data ? decoder.decode(data) : decoder.flush()) self.postMessage(picture, [picture.y.buffer]);
    self.postMessage(null);
  };
}
