// Draws pictures into 8-bit RGBA: every view is a function from pixels to colours.

import { ENCODED, clippedTable, factorTable } from "viewer/curves.js";
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

const tables = new Map();
function remembered(kind, picture, asked, make) {
  const key = `${kind} ${picture.light.length}`, held = tables.get(key);
  if (held && held.asked === asked && held.light === picture.light) return held.table;
  const table = make();
  tables.set(key, { asked, table, light: picture.light });
  return table;
}

function drawFalse(out, picture, left, right, { gain, white, peak }) {
  const paint = painter(bands(white, peak * white));
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

// Draws `sides`, each {picture, view, from, to (0 to 1), gain, other, layer, mask, tint}.
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
