// Draws pictures into 8-bit RGBA: every view is a function from pixels to colours.

import { ACES } from "viewer/aces.js";
import { ENCODED, acesTable, clippedTable, factorTable } from "viewer/curves.js";
import { bands, painter } from "viewer/false_colour.js";

export const VIEWS = ["picture", "false", "difference", "map", "gain"];
let shared = null;

// Writes the columns from `left` to `right` of a picture to `out`, tone-mapped or clipped.
function drawPicture(out, picture, left, right, { gain, toneMap, peak }) {
  const { width, height, count: n, shown: codes, light } = picture;
  if (toneMap === "clip") {
    const t = remembered("clip", picture, gain, () => clippedTable(light, gain));
    for (let y = 0; y < height; y++)
      for (let p = y * width + left, end = y * width + right; p < end; p++)
        out[p] = 255 << 24 | t[codes[p + 2 * n]] << 16 | t[codes[p + n]] << 8 | t[codes[p]];
    return;
  }
  if (toneMap === "aces" && ACES) return drawAces(out, picture, left, right, gain);
  const factors = remembered(
    toneMap, picture, `${gain} ${peak}`, () => factorTable(light, gain, toneMap, peak));
  const top = light.length / 2;  // negative half floats lie above
  for (let y = 0; y < height; y++)
    for (let p = y * width + left, end = y * width + right; p < end; p++) {
      let r = codes[p], g = codes[p + n], b = codes[p + 2 * n];
      if (light.length === 65536) { if (r >= top) r = 0; if (g >= top) g = 0; if (b >= top) b = 0; }
      const f = factors[r > g ? (r > b ? r : b) : (g > b ? g : b)];
      const vr = light[r] * f, vg = light[g] * f, vb = light[b] * f;
      out[p] = 255 << 24
        | ENCODED[vb < 1 ? Math.sqrt(vb) * 4095 | 0 : 4095] << 16
        | ENCODED[vg < 1 ? Math.sqrt(vg) * 4095 | 0 : 4095] << 8
        | ENCODED[vr < 1 ? Math.sqrt(vr) * 4095 | 0 : 4095];
    }
}

const aces = ACES && Uint8Array.from(atob(ACES.rgb), (c) => c.charCodeAt(0));

// The output transform of ACES 2.0 for SDR, interpolated linearly in its table.
function drawAces(out, picture, left, right, gain) {
  const { width, height, count: n, shown: codes, light } = picture, { size } = ACES;
  const at = remembered("aces", picture, gain, () => acesTable(light, gain, ACES));
  const steps = [3, 3 * size, 3 * size * size], rgb = [0, 0, 0];
  for (let y = 0; y < height; y++)
    for (let p = y * width + left, end = y * width + right; p < end; p++) {
      const r = at[codes[p]], g = at[codes[p + n]], b = at[codes[p + 2 * n]];
      const i = Math.min(r | 0, size - 2), j = Math.min(g | 0, size - 2), k = Math.min(b | 0, size - 2);
      const base = i * steps[0] + j * steps[1] + k * steps[2], u = r - i, v = g - j, w = b - k;
      for (let c = 0; c < 3; c++) {
        let a = base + c, sum = 0;
        for (let z = 0; z < 2; z++, a += steps[2]) {
          const near = aces[a] * (1 - u) + aces[a + 3] * u;
          const far = aces[a + steps[1]] * (1 - u) + aces[a + steps[1] + 3] * u;
          sum += (near * (1 - v) + far * v) * (z ? w : 1 - w);
        }
        rgb[c] = sum + 0.5;
      }
      out[p] = 255 << 24 | rgb[2] << 16 | rgb[1] << 8 | rgb[0];
    }
}

const tables = new Map();
function remembered(kind, picture, asked, make) {
  const key = `${kind} ${picture.light.length}`, held = tables.get(key);
  if (held && held.asked === asked && held.light === picture.light) return held.table;
  const table = make();
  tables.set(key, { asked, table, light: picture.light });
  return table;
}

// In one scale for all sides, that of `scaleWhite`, whatever white in nits each has.
function drawFalse(out, picture, left, right, { gain, white, scaleWhite = white, peak }) {
  const paint = painter(bands(scaleWhite, peak * scaleWhite));
  eachPixel(picture, left, right, (p) => { out[p] = paint(picture.luminance(p) * white * gain); });
}

function eachPixel({ width, height }, left, right, work) {
  for (let y = 0; y < height; y++)
    for (let p = y * width + left, end = y * width + right; p < end; p++) work(p);
}

const grey = (level) => {
  const code = Math.min(255, Math.max(0, Math.round(level * 255)));
  return (255 << 24 | code << 16 | code << 8 | code) >>> 0;
};

// The difference of two pictures: black to lightest is 4 stops; blue is darker.
function drawDifference(out, picture, other, left, right) {
  eachPixel(picture, left, right, (p) => {
    const stops = Math.log2((picture.luminance(p) + 1e-3) / (other.luminance(p) + 1e-3));
    const level = Math.min(1, Math.abs(stops) / 4) ** 0.7 * 255;
    out[p] = stops >= 0 ? 255 << 24 | level * 0.35 << 16 | level * 0.75 << 8 | level
      : 255 << 24 | level << 16 | level * 0.6 << 8 | level * 0.1;
  });
}

// Hatches clipped areas in magenta and black, a pattern that no picture contains.
function drawMask(out, mask, left, right) {
  const { width, codes, light } = mask;
  eachPixel(mask, left, right, (p) => {
    if (light[codes[p]] < 0.5) return;
    const stripe = (p % width + Math.floor(p / width)) >> 2 & 1;
    out[p] = stripe ? (255 << 24 | 200 << 16 | 60 << 8 | 230) >>> 0 : 255 << 24;
  });
}

// Overlays a map of any size in light blue.
function drawTint(out, tint, picture, left, right) {
  const { width, height } = picture, { codes, light } = tint;
  eachPixel(picture, left, right, (p) => {
    const row = Math.floor(Math.floor(p / width) * tint.height / height);
    const m = light[codes[row * tint.width + Math.floor(p % width * tint.width / width)]] * 0.75;
    const was = out[p], r = was & 255, g = was >> 8 & 255, b = was >> 16 & 255;
    out[p] = 255 << 24 | b + m * (233 - b) << 16 | g + m * (180 - g) << 8 | r + m * (86 - r);
  });
}

// Draws `sides`, each {picture, view, from, to (0 to 1), gain, other, layer, mask, tint,
// and white, if it has another in nits than the rest}.
export function draw(canvas, sides, common) {
  const { width, height } = sides[0].picture;
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  const context = canvas.getContext("2d");
  if (!shared || shared.width !== width || shared.height !== height)
    shared = context.createImageData(width, height);
  const out = new Uint32Array(shared.data.buffer);
  for (const side of sides) {
    const left = Math.round(side.from * width), right = Math.round(side.to * width);
    const { picture, other, layer, mask } = side, asked = { ...common, ...side };
    if (side.view === "false") drawFalse(out, picture, left, right, asked);
    else if (side.view === "difference" && other) drawDifference(out, picture, other, left, right);
    else if (side.view === "map" && layer)
      eachPixel(layer, left, right, (p) => { out[p] = grey(layer.light[layer.codes[p]]); });
    else if (side.view === "gain" && layer)
      eachPixel(layer, left, right, (p) => {
        out[p] = grey(Math.log2(Math.max(layer.light[layer.codes[p]], 1e-3)) / 6);
      });
    else drawPicture(out, picture, left, right, asked);
    if (mask) drawMask(out, mask, left, right);
    if (side.tint) drawTint(out, side.tint, picture, left, right);
  }
  context.putImageData(shared, 0, 0);
}
