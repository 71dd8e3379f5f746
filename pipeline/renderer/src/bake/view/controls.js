// Connects the renderer with the controls of the page.
function start(renderer) {
  const gl = renderer.gl;
  const camera = new Camera();
  const look = { gain: 1, coatMode: 0, isStill: false };
  const keys = new Set();
  const pointers = new Map();
  let [isDirty, isTurning, before, times] = [true, false, 0, []];
  // Draw shadow rays once the picture has been still for a while, unless its last frame took long [ms].
  let [changed, isRefined, cost] = [0, false, 0];
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
      [changed, isRefined] = [now, false];
      renderer.show(camera, look, { width: size[0], height: size[1], factor: 1, framebuffer: null });
      if (now - before < 5000) times.push(now - before);
      times = times.slice(-20);
      const mean = times.reduce((sum, time) => sum + time, 0) / times.length;
      if (times.length > 1) element("speed").textContent = `${mean.toFixed(1)} ms · ${(1000 / mean).toFixed(0)} frames/s`;
    } else {
      times = [];
      if (before === changed) cost = now - before;
      if (!isRefined && now - changed > 400 && cost < 250 && size[0] > 0 && size[1] > 0) {
        isRefined = true;
        renderer.show(camera, { ...look, isStill: true }, { width: size[0], height: size[1], factor: 1, framebuffer: null });
      }
    }
    before = now;
    requestAnimationFrame(frame);
  };
  requestAnimationFrame(frame);

  // Functions for tests: a picture of the current view, and the mean time of frames including their completion [ms].
  window.renderStill = (width, height) => {
    isDirty = true;
    return renderer.still(camera, { ...look, isStill: true }, width, height);
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
