// Waveform and histogram in nits on PQ's scale, and a vectorscope in u'v'.

import { pqCode } from "viewer/curves.js";

const MARKS = [0.1, 1, 10, 100, 1000, 4000, 10000];
const LEFT = 42;

// Draws a scope of a picture to a canvas, from at most about 150,000 of its pixels.
export function drawScope(canvas, kind, picture, white) {
  const ratio = window.devicePixelRatio || 1;
  const width = Math.round(canvas.clientWidth * ratio), height = Math.round(canvas.clientHeight * ratio);
  if (!width || !height) return;
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  const context = canvas.getContext("2d");
  context.fillStyle = "#0c0c0c";
  context.fillRect(0, 0, width, height);
  if (kind === "vectorscope") return vectorscope(context, width, height, picture);
  const left = LEFT * ratio, across = width - left;
  context.font = `${11 * ratio}px system-ui, sans-serif`;
  context.textAlign = "right";
  for (const nits of [...MARKS, white]) {
    const y = height * (1 - pqCode(nits));
    const isWhite = nits === white;
    context.fillStyle = isWhite ? "#e69f00" : "#2e2e2e";
    context.fillRect(left, y, across, isWhite ? ratio : 1);
    context.fillStyle = isWhite ? "#e69f00" : "#9a9a9a";
    if (isWhite || Math.abs(pqCode(nits) - pqCode(white)) * height > 12 * ratio)
      context.fillText(nits >= 1 ? `${Math.round(nits)}` : `${nits}`, left - 4 * ratio,
        Math.min(height - 2, Math.max(10 * ratio, y + 4 * ratio)));
  }
  const level = pqTable(picture.light, white);
  if (kind === "waveform") waveform(context, left, across, height, picture, level);
  else histogram(context, left, across, height, picture, white);
}

let table = { light: null };
function pqTable(light, white) {
  if (table.light !== light || table.white !== white)
    table = { light, white, levels: Float32Array.from(light, (v) => pqCode(v * white)) };
  return table.levels;
}

function* sampled(picture, most = 150000) {
  const step = Math.max(1, Math.ceil(Math.sqrt(picture.count / most)));
  for (let y = 0; y < picture.height; y += step)
    for (let x = 0; x < picture.width; x += step) yield [x, y * picture.width + x];
}

// An RGB waveform overlay: red, green and blue light add up.
function waveform(context, left, across, height, picture, level) {
  const columns = Math.min(across, picture.width, 480), rows = Math.min(height, 320);
  const counts = new Uint32Array(3 * columns * rows), scale = columns / picture.width;
  let samples = 0;
  for (const [x, p] of sampled(picture)) {
    const column = Math.floor(x * scale);
    samples++;
    for (let k = 0; k < 3; k++) {
      const code = picture.codes[p + (k % picture.channels) * picture.count];
      counts[3 * (Math.round((rows - 1) * (1 - level[code])) * columns + column) + k]++;
    }
  }
  const small = new OffscreenCanvas(columns, rows), inner = small.getContext("2d");
  const image = inner.createImageData(columns, rows), out = image.data;
  const most = samples / columns / 6;  // a sixth of a column at one level is drawn at full brightness
  for (let i = 0; i < columns * rows; i++) {
    const [r, g, b] = [0, 1, 2].map((k) => Math.min(1, (counts[3 * i + k] / most) ** 0.6));
    out[4 * i] = 255 * Math.min(1, r + 0.25 * b);
    out[4 * i + 1] = 255 * Math.min(1, 0.9 * g + 0.35 * b);
    out[4 * i + 2] = 255 * Math.min(1, b + 0.15 * r);
    out[4 * i + 3] = 255 * Math.max(r, g, b);
  }
  inner.putImageData(image, 0, 0);
  context.imageSmoothingEnabled = true;
  context.drawImage(small, left, 0, across, height);
}

function histogram(context, left, across, height, picture, white) {
  const bins = 160, counts = new Float64Array(bins);
  for (const [, p] of sampled(picture))
    counts[Math.min(bins - 1, Math.floor(pqCode(picture.luminance(p) * white) * bins))]++;
  const most = Math.max(1, ...counts);
  counts.forEach((count, i) => {
    if (!count) return;
    context.fillStyle = (i + 0.5) / bins > pqCode(white) ? "#f0b840" : "#56b4e9";
    const long = across * Math.sqrt(count / most) * 0.96;
    context.fillRect(left, height * (1 - (i + 1) / bins), long, Math.max(1, height / bins - 1));
  });
}

const UV = { u: [0, 0.62], v: [0, 0.6] };
const GAMUTS = {
  "709": [[0.4507, 0.5229], [0.125, 0.5625], [0.1754, 0.1579]],
  "2020": [[0.5566, 0.5165], [0.0556, 0.5868], [0.1593, 0.1258]],
};

function vectorscope(context, width, height, picture) {
  const side = Math.min(width, height), x0 = (width - side) / 2, y0 = (height - side) / 2;
  const place = (u, v) => [x0 + u / UV.u[1] * side, y0 + side - v / UV.v[1] * side];
  context.lineWidth = 1;
  for (const [name, corners] of Object.entries(GAMUTS)) {
    context.strokeStyle = "#666";
    context.setLineDash(name === "2020" ? [4, 4] : []);
    context.beginPath();
    [...corners, corners[0]].forEach((uv, i) => context[i ? "lineTo" : "moveTo"](...place(...uv)));
    context.stroke();
  }
  context.setLineDash([]);
  const [wx, wy] = place(0.1978, 0.4683);
  context.strokeStyle = "#e69f00";
  context.strokeRect(wx - 4, wy - 4, 8, 8);
  const [x, y, z] = picture.primaries.to_xyz;
  context.fillStyle = "rgba(170, 225, 240, 0.25)";
  for (const [, p] of sampled(picture, 40000)) {
    const [r, g, b] = picture.rgb(p);
    const X = x[0] * r + x[1] * g + x[2] * b, Y = y[0] * r + y[1] * g + y[2] * b;
    const Z = z[0] * r + z[1] * g + z[2] * b, sum = X + 15 * Y + 3 * Z;
    if (Y < 1e-4 || sum < 1e-6) continue;
    const [px, py] = place(4 * X / sum, 9 * Y / sum);
    context.fillRect(px, py, 1.5, 1.5);
  }
}
