
// Player of the MPEG-2 streams that are embedded in a page: single frames, and all frames in a loop.

function textOf(id) {
  return document.getElementById(id).textContent;
}

function bytesOf(base64) {
  const characters = atob(base64);
  const bytes = new Uint8Array(characters.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = characters.charCodeAt(i);
  return bytes;
}

/** Decodes any picture of a stream. Decoding starts at I pictures: `entries` are their offsets and positions. */
class FrameReader {
  constructor(decoder, { bytes, entries }) {
    Object.assign(this, { decoder, bytes, entries, next: 0, pictures: null });
  }
  *decode(offset) {
    this.decoder.reset();
    yield* this.decoder.decode(this.bytes.subarray(offset));
    yield* this.decoder.flush();
  }
  /** Returns the picture at a position, or `null` after the end of the stream. */
  picture(position) {
    const [offset, start] = this.entries.findLast((entry) => entry[1] <= position);
    if (!this.pictures || position < this.next || start > this.next) {
      [this.pictures, this.next] = [this.decode(offset), start];
    }
    for (;;) {
      const { value } = this.pictures.next();
      if (!value) return (this.pictures = null);
      if (this.next++ === position) return value;
    }
  }
}

/** Stream that is decoded in a worker, or in the page if the browser starts no worker. */
class Film {
  static async open(module, { base64, entries, count }) {
    const film = new Film();
    const stream = { bytes: bytesOf(base64), entries };
    film.count = count;
    try {
      await film.start(module, stream);
    } catch {
      const reader = new FrameReader(await Decoder.create(module), stream);
      film.picture = async (position) => reader.picture(position);
    }
    return film;
  }
  /** Starts a worker, which executes this script. Pages that are files cannot start workers that are modules. */
  start(module, stream) {
    const script = textOf("player").replace(/^export /gm, "").replaceAll("import.meta.url", '""');
    const url = URL.createObjectURL(new Blob([script], { type: "text/javascript" }));
    this.waiting = [];
    return new Promise((resolve, reject) => {
      this.worker = new Worker(url, { name: "film" });
      this.worker.onerror = (event) => [event.preventDefault(), reject(event)];
      this.worker.onmessage = ({ data }) => (data === "ready" ? resolve() : this.waiting.shift()(data));
      this.worker.postMessage({ module, ...stream });
    });
  }
  picture(position) {
    this.worker.postMessage(position);
    return new Promise((resolve) => this.waiting.push(resolve));
  }
  close() {
    this.worker?.terminate();
  }
}

/** Answers the messages of a page in a worker: first the stream, then positions of pictures. */
function serve() {
  let reader = null;
  self.onmessage = async ({ data }) => {
    if (reader === null) {
      reader = new FrameReader(await Decoder.create(data.module), data);
      return self.postMessage("ready");
    }
    const picture = reader.picture(data);
    self.postMessage(picture, picture ? [picture.y.buffer] : []);
  };
}

/** Shows one stream, or several streams at the same position, in the canvases of an element. */
class FilmPlayer {
  constructor(root, { playback, streams }) {
    Object.assign(this, { root, playback, streams, shown: -1, wanted: playback.start, isBusy: false, clock: null, ahead: null });
    this.module = bytesOf(textOf("module"));
    this.films = [];
    this.renderers = [...root.querySelectorAll("canvas")].map((canvas) => new Renderer(canvas));
    [this.button, this.range, this.label] = ["button", ".scrubber", "output"].map((name) => root.querySelector(name));
    this.choices = [...root.querySelectorAll("select")];
    const [divider, split] = [root.querySelector(".divider"), root.querySelector(".split")];
    if (divider) divider.oninput = () => split.style.setProperty("--cut", `${divider.value}%`);
  }
  async start() {
    for (let i = 0; i < this.renderers.length; i++) await this.open(i);
    this.button.onclick = () => this.play(!this.clock);
    this.range.oninput = () => this.seek(Number(this.range.value));
    this.choices.forEach((choice, i) => (choice.onchange = () => this.open(i).then(() => this.seek(this.wanted))));
    document.addEventListener("keydown", (event) => this.key(event));
    for (const link of document.querySelectorAll("[data-frame]")) link.onclick = () => this.seek(this.positionOf(link));
    await this.show(this.wanted);
    this.root.classList.add("is-ready");
    this.play(this.playback.plays && !matchMedia("(prefers-reduced-motion: reduce)").matches);
  }
  /** Opens the stream that is chosen for a canvas. */
  async open(i) {
    const film = await Film.open(this.module, this.streams[Number(this.choices[i]?.value ?? i)]);
    this.films[i]?.close();
    this.films[i] = film;
    [this.shown, this.ahead] = [-1, null];
    this.count = Math.min(...this.films.map((film) => film.count));
    this.range.max = this.count - 1;
    this.wanted = Math.min(this.wanted, this.count - 1);
  }
  positionOf(link) {
    return (Number(link.dataset.frame) - this.playback.first) * this.playback.repeats;
  }
  /** Decodes a picture of each stream, unless this was begun in advance. */
  pictures(position) {
    if (this.ahead?.position === position) return this.ahead.pictures;
    return Promise.all(this.films.map((film) => film.picture(position)));
  }
  /** Shows the last wanted picture. Pictures that were wanted meanwhile are skipped. */
  async show(wanted) {
    this.wanted = Math.max(0, Math.min(wanted, this.count - 1));
    if (this.isBusy) return;
    this.isBusy = true;
    while (this.shown !== this.wanted) {
      const next = this.wanted;
      const pictures = await this.pictures(next);
      pictures.forEach((picture, i) => picture && this.renderers[i].draw(picture));
      this.shown = next;
    }
    this.isBusy = false;
    // Decode the next picture of the loop before it is due.
    const position = (this.shown + 1) % this.count;
    this.ahead = this.clock ? { position, pictures: this.pictures(position) } : null;
    const frame = this.playback.first + Math.floor(this.shown / this.playback.repeats);
    this.range.value = this.shown;
    this.label.value = `Frame ${frame}, ${(this.shown / this.playback.rate).toFixed(2)} s`;
    this.root.dataset.frame = frame;
  }
  seek(position) {
    this.play(false);
    return this.show(position);
  }
  /** Starts or ends the loop over all pictures. */
  play(isOn) {
    this.clock = isOn ? { begin: performance.now(), from: this.shown } : null;
    this.button.textContent = isOn ? "Pause" : "Play";
    if (isOn) requestAnimationFrame((now) => this.tick(now));
  }
  tick(now) {
    if (!this.clock) return;
    const passed = Math.floor((Math.max(0, now - this.clock.begin) * this.playback.rate) / 1000);
    if (!this.isBusy) this.show((this.clock.from + passed) % this.count);
    requestAnimationFrame((next) => this.tick(next));
  }
  /** Splayback plays or pauses; arrow keys, Home and End show another picture. */
  key(event) {
    const isIn = (selector) => event.target.closest?.(selector);
    const isTaken = isIn("select, .divider") || (event.key === " " && isIn("button, summary"));
    if (isTaken || event.ctrlKey || event.altKey || event.metaKey) return;
    const position = { ArrowLeft: this.wanted - 1, ArrowRight: this.wanted + 1, Home: 0, End: this.count - 1 }[event.key];
    if (position !== undefined) this.seek((position + this.count) % this.count);
    else if (event.key === " ") this.play(!this.clock);
    else return;
    event.preventDefault();
  }
}

if (typeof document === "undefined") {
  serve();
} else {
  const root = document.querySelector(".player");
  const start = async () => {
    window.player = new FilmPlayer(root, JSON.parse(textOf("streams")));
    await window.player.start();
    document.documentElement.dataset.ready = "yes";
  };
  start().catch((error) => {
    root.querySelector(".failure").textContent = `This browser cannot play the film: ${error.message ?? error}`;
  });
}
