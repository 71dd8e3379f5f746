// Connection and decoder of the page: receives pictures, acknowledges them, and sends inputs.
import { Decoder } from "./mpeg2dec.js";

const HEADER = 64; // bytes
const NEXT = new Uint8Array([0, 0, 1, 0xb2]); // a start code, which ends the picture before it
const LONGEST_PAUSE = 4000; // ms between attempts to connect
const loading = Decoder.create(new URL("mpeg2dec.wasm", import.meta.url));
let [socket, pause, address] = [null, 250, ""];

/** Reads the header of a picture; see `PictureHeader` in the server. */
function header(view) {
  const [u32, f32] = [(at) => view.getUint32(at, true), (at) => view.getFloat32(at, true)];
  return {
    type: " IP"[view.getUint8(1)], plays: (view.getUint8(2) & 1) > 0, moves: (view.getUint8(2) & 2) > 0,
    viewers: view.getUint8(3), sequence: u32(4), input: u32(8), bits: u32(12), quantiser: u32(16),
    waited: u32(20) / 1000, rendered: u32(24) / 1000, cpu: u32(28) / 1e6, threshold: f32(32), rate: f32(36),
    roundTrip: f32(40) * 1000, computed: f32(44), serverCpu: view.getFloat64(48, true),
  };
}

function send(message) {
  if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
}

async function connect() {
  const decoder = await loading;
  decoder.reset();
  socket = new WebSocket(address);
  socket.binaryType = "arraybuffer";
  socket.onopen = () => (pause = 250);
  socket.onmessage = ({ data }) => {
    if (typeof data === "string") {
      send({ kind: "hello" });
      postMessage({ role: JSON.parse(data) });
      return;
    }
    const arrived = performance.now();
    const figures = header(new DataView(data));
    let last = null;
    for (const bytes of [new Uint8Array(data, HEADER), NEXT]) for (const picture of decoder.decode(bytes)) last = picture;
    figures.decoded = performance.now() - arrived;
    send({ kind: "seen", sequence: figures.sequence, held: Math.round(1000 * figures.decoded) });
    if (last) postMessage({ figures, picture: last }, [last.y.buffer]);
  };
  socket.onclose = ({ reason }) => {
    postMessage({ lost: reason || "Connection lost, trying again" });
    setTimeout(connect, pause);
    pause = Math.min(2 * pause, LONGEST_PAUSE);
  };
}

onmessage = ({ data }) => {
  if (data.address) {
    address = data.address;
    connect();
  } else {
    send(data);
  }
};
