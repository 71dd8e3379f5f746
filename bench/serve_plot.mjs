// Plot of `serve.mjs lines`: quantiser, CPU time, delay, queue and memory over time, as SVG.

const [WIDTH, PANEL, LEFT, RIGHT, TOP, GAP] = [720, 84, 108, 12, 34, 16];
const PANELS = [
  { name: "quantiser", unit: "logarithmic", value: (sample) => sample.quantiser, least: 1 },
  { name: "CPU", unit: "ms per picture", value: (sample) => sample.cpu },
  { name: "delay", unit: "ms, longest of 1 s", value: (sample) => sample.delay, limit: 300 },
  { name: "queue", unit: "kbit, longest of 1 s", value: (sample) => sample.queued, isAlways: true },
  { name: "memory", unit: "MB of the server", value: (sample) => sample.memory, isAlways: true },
];

// Rounds up to 1, 2 or 5 times a power of ten.
function roundUp(value) {
  const power = 10 ** Math.floor(Math.log10(Math.max(value, 1e-9)));
  return power * [1, 2, 3, 5, 10].find((factor) => factor * power >= value);
}

const rateName = (rate) => (rate < 1e6 ? `${rate / 1e3} kbit/s` : `${rate / 1e6} Mbit/s`);
const text = (x, y, content, more = "") => `<text x="${x.toFixed(1)}" y="${y.toFixed(1)}" ${more}>${content}</text>`;

// Returns the plot of samples, one a second.
export function plot(samples) {
  const end = samples.at(-1).at;
  const x = (at) => LEFT + ((WIDTH - LEFT - RIGHT) * at) / end;
  const height = TOP + PANELS.length * (PANEL + GAP) + 22;
  const parts = [];

  // Lines of the network, with their rates
  const rates = [...new Set(samples.map(({ rate }) => rate))];
  const begins = rates.map((rate) => samples.find((sample) => sample.rate === rate).at);
  rates.forEach((rate, k) => {
    const from = x(k ? begins[k] : 0);
    const to = x(k + 1 < rates.length ? begins[k + 1] : end);
    parts.push(text((from + to) / 2, 20, `line of ${rateName(rate)}`, 'text-anchor="middle" font-weight="bold"'));
    if (k) parts.push(`<path d="M${from.toFixed(1)} ${TOP - 6}V${height - 22 - GAP}" stroke="#999" stroke-dasharray="3 3"/>`);
  });

  PANELS.forEach(({ name, unit, value, limit, least, isAlways }, k) => {
    const bottom = TOP + k * (PANEL + GAP) + PANEL;
    const known = samples.filter((sample) => isAlways || sample.pictures);
    const most = roundUp(Math.max(limit ?? 0, ...known.map(value)));
    const share = (value) => (least ? Math.log(value / least) / Math.log(most / least) : value / most);
    const y = (value) => bottom - PANEL * share(value);
    parts.push(`<path d="M${LEFT} ${bottom - PANEL}V${bottom}H${WIDTH - RIGHT}" stroke="#666" fill="none"/>`);
    parts.push(text(LEFT - 6, bottom - PANEL + 10, most, 'text-anchor="end"'), text(LEFT - 6, bottom, least ?? 0, 'text-anchor="end"'));
    parts.push(text(4, bottom - PANEL / 2 - 2, name, 'font-weight="bold"'), text(4, bottom - PANEL / 2 + 12, unit, 'font-size="9"'));
    if (limit) parts.push(`<path d="M${LEFT} ${y(limit).toFixed(1)}H${WIDTH - RIGHT}" stroke="#c33" stroke-dasharray="6 3"/>`);
    const points = known.map((sample) => `${x(sample.at).toFixed(1)},${y(value(sample)).toFixed(1)}`);
    parts.push(`<polyline points="${points.join(" ")}" fill="none" stroke="#1560a8" stroke-width="1.2"/>`);
  });
  for (let at = 0; at <= end; at += 100) parts.push(text(x(at), height - 10, `${at} s`, 'text-anchor="middle"'));
  return `<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 ${WIDTH} ${height}" font-family="sans-serif" font-size="11" fill="#222">
<rect width="100%" height="100%" fill="#fff"/>
${parts.join("\n")}
</svg>
`;
}
