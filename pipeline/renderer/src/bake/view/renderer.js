// Whether a material may have coats that are too smooth for baked light.
const isSmooth = (material) => material.coat && (material.roughness < 0.35 || Boolean(material.roughTexture));

// Draws the scene with a WebGL 2 context.
class Renderer {
  constructor(gl, blocks) {
    this.gl = gl;
    this.anisotropic = gl.getExtension("EXT_texture_filter_anisotropic");
    this.largest = gl.getParameter(gl.MAX_TEXTURE_SIZE);
    if (Math.max(scene.light.width, scene.light.height) > this.largest) {
      throw new Error(`The light has ${scene.light.width}×${scene.light.height} texels, but this device supports ${this.largest}. Bake fewer --texels.`);
    }
    // Variants of the surface program, by their options.
    this.surfaces = {};
    this.sky = this.program("sky");
    this.screen = this.program("screen");
    this.target = null;
    this.upload(blocks);
  }

  program(name, options = []) {
    const gl = this.gl;
    const program = gl.createProgram();
    const head = "#version 300 es\nprecision highp float;\nprecision highp int;\nprecision highp sampler2D;\n";
    const defined = options.map((option) => `#define ${option}\n`).join("");
    for (const [stage, kind] of [["vertex", gl.VERTEX_SHADER], ["fragment", gl.FRAGMENT_SHADER]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, head + defined + element(`${name}-${stage}`).textContent);
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

  // Returns the program of a batch. Software executes both sides of branches, so programs omit unused features.
  surfaceFor(batch, { coatMode, isStill }) {
    const material = scene.materials.list[batch.material];
    const options = [];
    if (material.coat) options.push("COAT");
    if (isSmooth(material) && coatMode === 0) options.push("REFLECTIONS");
    if (batch.blended) options.push("BLENDED");
    if (scene.light.live > 0) options.push(...(isStill ? ["LIVE", "SHADOW_RAYS"] : ["LIVE"]));
    return (this.surfaces[options] ??= this.program("surface", options));
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
    this.uploadCoats(blocks);
    this.blank = this.texels(1, 1, new Uint8Array([255, 255, 255, 255]), [gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE]);
    this.images = [];
  }

  // Creates a texture of numbers, four in a texel, in rows of 1024 texels.
  list(numbers) {
    const gl = this.gl;
    const height = Math.max(1, Math.ceil(numbers.length / 4096));
    if (height > this.largest) throw new Error("The scene has too many triangles for reflections on this device.");
    const padded = new Float32Array(4096 * height);
    padded.set(numbers);
    return this.texels(1024, height, padded, [gl.RGBA32F, gl.RGBA, gl.FLOAT]);
  }

  // Creates the textures of lamps in coats, and of reflection rays if any coat is too smooth for baked light.
  uploadCoats(blocks) {
    const gl = this.gl;
    const { light, materials } = scene;
    this.hasVisible = blocks.visible.length > 0;
    const [width, height] = this.hasVisible ? [light.width, light.height] : [1, 1];
    const visible = this.hasVisible ? blocks.visible : new Uint8Array(1);
    this.units.visibleImage = this.texels(width, height, visible, [gl.R8, gl.RED, gl.UNSIGNED_BYTE]);
    const points = scene.lamps > 0 ? new Float32Array(blocks.lamps.buffer) : new Float32Array(12);
    this.units.lampImage = this.texels(3, points.length / 12, points, [gl.RGBA32F, gl.RGBA, gl.FLOAT]);
    const hasRays = materials.list.some(isSmooth) || light.live > 0;
    const { nodes, records } = hasRays ? rayGeometry(blocks) : { nodes: new Float32Array(0), records: new Float32Array(0) };
    const both = new Float32Array(nodes.length + records.length);
    both.set(nodes);
    both.set(records, nodes.length);
    this.units.rayImage = this.list(both);
    this.firstTriangle = nodes.length / 4;
    this.units.materialImage = this.list(materials.list.flatMap((one) => [...one.mean, one.metallic, ...one.f0, one.roughness,
      ...one.emission, one.lamp ? 1 : 0]));
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
    this.factor = factor;
    const target = this.buffers(w, h);
    gl.bindFramebuffer(gl.FRAMEBUFFER, target.many);
    this.draw(camera, look, w, h);
    this.resolve(w, h);
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

  // Copies the means of the samples of width × height pixels into the texture of the target.
  resolve(width, height) {
    const gl = this.gl;
    gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, this.target.single);
    gl.blitFramebuffer(0, 0, width, height, 0, 0, width, height, gl.COLOR_BUFFER_BIT, gl.NEAREST);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.target.many);
  }

  setBehind(places, texture, unit) {
    const gl = this.gl;
    gl.activeTexture(gl.TEXTURE0 + unit);
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.uniform1i(places.behindImage, unit);
  }

  // Draws the scene into the framebuffer of several samples, which has width × height pixels.
  draw(camera, look, width, height) {
    const gl = this.gl;
    const half = camera.half(width / height);
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.disable(gl.BLEND);
    gl.depthMask(true);
    if (scene.sky) this.drawSky(camera, half, look.gain, [width, height]);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.enable(gl.CULL_FACE);
    gl.bindVertexArray(this.vertices);
    let [surface, unit, isBlending] = [null, 0, false];
    for (const batch of scene.batches) {
      if (batch.blended && !isBlending) {
        // Blended surfaces are last. They read the opaque picture.
        isBlending = true;
        this.resolve(width, height);
        gl.enable(gl.BLEND);
        gl.blendFuncSeparate(gl.ONE, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE);
        gl.depthMask(false);
      }
      const wanted = this.surfaceFor(batch, look);
      if (wanted !== surface) {
        surface = wanted;
        unit = this.use(surface, look.gain);
        this.setFrame(surface.places, camera, look, half);
      }
      this.setMaterial(surface.places, scene.materials.list[batch.material], unit);
      gl.uniform1i(surface.places.litBy, batch.lit);
      this.setBehind(surface.places, isBlending ? this.target.texture : this.blank, unit + 3);
      gl.drawElements(gl.TRIANGLES, batch.count, gl.UNSIGNED_INT, 4 * batch.first);
    }
    gl.bindVertexArray(null);
    gl.depthMask(true);
  }

  // Sets the uniforms of a surface program that are equal in all batches.
  setFrame(places, camera, { coatMode }, half) {
    const gl = this.gl;
    gl.uniformMatrix4fv(places.clipFromWorld, false, camera.clipFromWorld(half));
    gl.uniform3fv(places.eye, camera.eye);
    gl.uniform3fv(places.forward, camera.forward);
    gl.uniform1i(places.parallel, scene.camera.parallel);
    gl.uniform3fv(places.meanLight, scene.light.mean);
    gl.uniform1i(places.coatMode, coatMode);
    gl.uniform1i(places.hasCoats, this.hasCoats);
    gl.uniform1i(places.albedoSteps, scene.light.steps);
    gl.uniform1i(places.lampPoints, scene.lamps);
    gl.uniform1i(places.hasGroups, this.factor === 2);
    gl.uniform1i(places.hasVisible, this.hasVisible);
    gl.uniform1i(places.firstTriangle, this.firstTriangle);
    gl.uniform1i(places.hasSky, Boolean(scene.sky));
    gl.uniform1f(places.epsilon, scene.epsilon);
    this.setSky(places);
  }

  setSky(places) {
    const colors = scene.sky?.gradient;
    this.gl.uniform1i(places.isGradient, Boolean(colors));
    if (colors) ["zenith", "horizon", "ground"].forEach((name, k) => this.gl.uniform3fv(places[name], colors[k]));
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
    this.setSky(places);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  setMaterial(places, material, unit) {
    const gl = this.gl;
    gl.uniform3fv(places.baseColor, material.base);
    gl.uniform1f(places.opacityFactor, material.opacity);
    gl.uniform1i(places.alphaMode, material.alpha);
    gl.uniform1f(places.cutoff, material.cutoff);
    gl.uniform1f(places.metallicFactor, material.metallic);
    gl.uniform1f(places.roughnessFactor, material.roughness);
    gl.uniform3fv(places.dielectric, material.f0);
    gl.uniform3fv(places.emission, material.emission);
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
