// Page of a live scene: shows pictures, and sends the inputs of mouse, touch and keys.
import { Renderer } from "./mpeg2dec.js";

const byId = (id) => document.getElementById(id);
const canvas = byId("picture");
const renderer = new Renderer(canvas);
const worker = new Worker(new URL("worker.js", import.meta.url), { type: "module", name: "live" });
const KEYS = {
  KeyW: 1, KeyS: 2, KeyA: 4, KeyD: 8, KeyE: 16, KeyQ: 32,
  ArrowLeft: 64, ArrowRight: 128, ArrowUp: 256, ArrowDown: 512, ShiftLeft: 1024, ShiftRight: 1024,
};
const BEST = [16, 8, 6, 4, 2, 1]; // quantisers of static views, by the quality slider
const NAMES = ["low", "fair", "medium", "good", "high", "best"];
const RATES = [100e3, 200e3, 300e3, 500e3, 1e6, 2e6, 4e6, 8e6, 16e6, null]; // bits/s
let [number, keys, plays, looks] = [0, 0, false, false];
let [arrivals, shown] = [[], null];

// Names the page, so that a controller that comes back goes on.
const client = (sessionStorage.client ||= Array.from(crypto.getRandomValues(new Uint8Array(8)), (b) => b.toString(16)).join(""));
const query = new URLSearchParams(location.search);
const token = query.has("token") ? `&token=${query.get("token")}` : "";
worker.postMessage({ address: `ws://${location.host}/pictures?client=${client}${token}` });

const control = (controls) => worker.postMessage({ kind: "control", number: ++number, controls });

// Pictures and messages of the server
worker.onmessage = ({ data }) => {
  if (data.picture) show(data.picture, data.figures);
  if (data.role) setRole(data.role);
  if (data.lost) byId("status").textContent = data.lost;
};

function show(picture, figures) {
  renderer.draw(picture);
  canvas.style.aspectRatio = "";
  [shown, plays] = [figures, figures.plays];
  arrivals.push({ at: performance.now(), bits: figures.bits });
  byId("play").textContent = plays ? "Pause" : "Play";
  byId("play").setAttribute("aria-pressed", plays);
}

function setRole(role) {
  byId("status").textContent = role.role === "controller" ? "" : "Watching";
  byId("play").hidden = !role.is_animated;
  const quality = BEST.findIndex((best) => best <= role.best);
  byId("quality").value = quality < 0 ? BEST.length - 1 : quality;
  const rate = RATES.findIndex((rate) => rate === null || (role.bits_per_second !== null && rate >= role.bits_per_second));
  byId("rate").value = role.bits_per_second === null ? RATES.length - 1 : rate;
  setTexts();
}

// Figures
const FIGURES = {
  "pictures/s": () => arrivals.length,
  "rate": () => `${(arrivals.reduce((sum, { bits }) => sum + bits, 0) / 1000).toFixed(0)} kbit/s`,
  "picture": () => `${shown.type}, ${(shown.bits / 1000).toFixed(1)} kbit`,
  "quantiser": () => shown.quantiser,
  "threshold": () => `${(100 * shown.threshold).toFixed(1)} %`,
  "light computed": () => `${(100 * shown.computed).toFixed(0)} %`,
  "waited": () => `${shown.waited.toFixed(0)} ms`,
  "rendered": () => `${shown.rendered.toFixed(0)} ms`,
  "round trip": () => `${shown.roundTrip.toFixed(0)} ms`,
  "decoded": () => `${shown.decoded.toFixed(1)} ms`,
  "CPU per picture": () => `${(1000 * shown.cpu).toFixed(0)} ms`,
  "CPU of server": () => `${shown.serverCpu.toFixed(1)} s`,
  "viewers": () => shown.viewers,
};
const cells = {};
for (const name of Object.keys(FIGURES)) {
  const [term, cell] = [document.createElement("dt"), document.createElement("dd")];
  term.textContent = name;
  cells[name] = cell;
  byId("figures").append(term, cell);
}
setInterval(() => {
  const since = performance.now() - 1000;
  arrivals = arrivals.filter(({ at }) => at > since);
  if (shown && !byId("figures").hidden) for (const name in FIGURES) cells[name].textContent = FIGURES[name]();
}, 250);

// Buttons and sliders
function toggle(id, panel) {
  byId(panel).hidden = !byId(panel).hidden;
  byId(id).setAttribute("aria-pressed", !byId(panel).hidden);
}
function capture() {
  canvas.toBlob((blob) => {
    const link = document.createElement("a");
    [link.href, link.download] = [URL.createObjectURL(blob), "render2mpeg.png"];
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  });
}
function setDrag() {
  looks = !looks;
  byId("drag").setAttribute("aria-pressed", looks);
}
const ACTIONS = {
  KeyP: ["play", () => control({ play: !plays })],
  KeyR: ["reset", () => control({ reset: true })],
  KeyO: ["drag", setDrag],
  KeyC: ["capture", capture],
  KeyF: ["figures-shown", () => toggle("figures-shown", "figures")],
  KeyH: ["help-shown", () => toggle("help-shown", "help")],
  Equal: [null, () => control({ zoom: 0.15 })],
  NumpadAdd: [null, () => control({ zoom: 0.15 })],
  Minus: [null, () => control({ zoom: -0.15 })],
  NumpadSubtract: [null, () => control({ zoom: -0.15 })],
};
for (const [id, act] of Object.values(ACTIONS)) if (id) byId(id).onclick = act;
function setTexts() {
  byId("quality-text").textContent = NAMES[byId("quality").value];
  const rate = RATES[byId("rate").value];
  byId("rate-text").textContent = rate ? (rate < 1e6 ? `${rate / 1e3} kbit/s` : `${rate / 1e6} Mbit/s`) : "no limit";
}
for (const id of ["quality", "rate"]) {
  byId(id).oninput = () => {
    setTexts();
    worker.postMessage({ kind: "limits", bits_per_second: RATES[byId("rate").value], best: BEST[byId("quality").value] });
  };
}
setTexts();

// Keys
function setKeys(next) {
  if (next !== keys) control({ keys: (keys = next) });
}
addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches("input")) return;
  const key = KEYS[event.code];
  if (key) setKeys(keys | key);
  else if (ACTIONS[event.code] && !event.repeat) ACTIONS[event.code][1]();
  else return;
  event.preventDefault();
});
addEventListener("keyup", ({ code }) => KEYS[code] && setKeys(keys & ~KEYS[code]));
addEventListener("blur", () => setKeys(0));
for (const button of document.querySelectorAll("#pad button")) {
  const key = Number(button.dataset.key);
  button.onpointerdown = () => setKeys(keys | key);
  for (const end of ["pointerup", "pointercancel", "pointerleave"]) button.addEventListener(end, () => setKeys(keys & ~key));
}

// Mouse and touch: movements are sent once per frame of the display.
const pointers = new Map();
let moved = null;
function move(name, x, y) {
  if (!moved) requestAnimationFrame(() => [control(moved), (moved = null)]);
  moved ??= {};
  if (name === "zoom") moved.zoom = (moved.zoom ?? 0) + x;
  else moved[name] = [(moved[name]?.[0] ?? 0) + x, (moved[name]?.[1] ?? 0) + y];
}
canvas.onpointerdown = (event) => {
  canvas.setPointerCapture(event.pointerId);
  canvas.focus();
  pointers.set(event.pointerId, event);
};
canvas.onpointermove = (event) => {
  const before = pointers.get(event.pointerId);
  if (!before) return;
  const size = Math.min(canvas.clientWidth, canvas.clientHeight);
  const [x, y] = [(event.clientX - before.clientX) / size, (event.clientY - before.clientY) / size];
  const other = [...pointers.values()].find(({ pointerId }) => pointerId !== event.pointerId);
  if (other) {
    const apart = (one) => Math.hypot(one.clientX - other.clientX, one.clientY - other.clientY);
    move("zoom", Math.log(Math.max(apart(event), 1) / Math.max(apart(before), 1)));
    move("pan", -x / 2, y / 2);
  } else if (before.buttons & 2) {
    move("pan", -x, y);
  } else if (looks) {
    move("turn", -1.5 * x, 1.5 * y);
  } else {
    move("orbit", 3 * x, -3 * y);
  }
  pointers.set(event.pointerId, event);
};
for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, ({ pointerId }) => pointers.delete(pointerId));
canvas.oncontextmenu = (event) => event.preventDefault();
canvas.addEventListener("wheel", (event) => {
  event.preventDefault();
  move("zoom", -0.0015 * event.deltaY * (event.deltaMode ? 30 : 1));
}, { passive: false });
canvas.focus();
