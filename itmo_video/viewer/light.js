// Pictures as codes for linear light, SDR white = 1, and the tables that decode them.

// The light that each of the 65536 half floats stands for.
export function halfLight() {
  const light = new Float32Array(65536);
  for (let bits = 0; bits < 65536; bits++) {
    const exponent = bits >> 10 & 31, fraction = bits & 1023;
    let value = exponent ? (1 + fraction / 1024) * 2 ** (exponent - 15) : fraction * 2 ** -24;
    if (exponent === 31) value = fraction ? 0 : 65504;
    light[bits] = bits & 0x8000 ? -value : value;
  }
  return light;
}

const float = new Float32Array(1), word = new Uint32Array(float.buffer);

// The half float nearest to a number, clamped to its range.
export function toHalf(value) {
  float[0] = Math.min(65504, Math.max(-65504, value));
  const bits = word[0], sign = bits >> 16 & 0x8000, exponent = (bits >> 23 & 255) - 112;
  if (exponent <= 0) return sign | Math.round(Math.abs(value) * 2 ** 24);
  return sign | (exponent << 10) + ((bits & 0x7fffff) + 0x1000 >> 13);
}

// One picture: planar `codes` (channels x height x width), decoded by `light`; `weights` give the
// luminance and `toXyz` CIE XYZ in its primaries. `shown` is the same in BT.709 for the monitor.
export class Picture {
  constructor({ width, height, channels, codes, light, primaries, key }) {
    Object.assign(this, { width, height, channels, codes, light, primaries, key });
    this.count = width * height;
    this.shown = channels === 3 && primaries.name !== "rec709" ? this.#in709() : codes;
  }

  #in709() {
    const n = this.count, out = new Uint16Array(3 * n), { codes, light } = this;
    const m = this.primaries.to_709;
    for (let p = 0; p < n; p++) {
      const r = light[codes[p]], g = light[codes[p + n]], b = light[codes[p + 2 * n]];
      for (let k = 0; k < 3; k++)
        out[p + k * n] = toHalf(Math.max(0, m[k][0] * r + m[k][1] * g + m[k][2] * b));
    }
    return out;
  }

  // R, G and B at a pixel, as stored in the file.
  rgb(p) {
    return [0, 1, 2].map((k) => this.light[this.codes[p + (k % this.channels) * this.count]]);
  }

  // Luminance at a pixel, SDR white = 1.
  luminance(p) {
    const { codes, light, count, primaries: { weights } } = this;
    if (this.channels === 1) return light[codes[p]];
    return weights[0] * light[codes[p]] + weights[1] * light[codes[p + count]]
      + weights[2] * light[codes[p + 2 * count]];
  }

  // The pixel at a position given from 0 to 1 across and down.
  at(x, y) {
    const column = Math.min(this.width - 1, Math.max(0, Math.floor(x * this.width)));
    const row = Math.min(this.height - 1, Math.max(0, Math.floor(y * this.height)));
    return row * this.width + column;
  }
}

// Read-out of a pixel: nits, stops relative to SDR white, CIE 1976 u' and v' (null for black).
export function probe(picture, p, white) {
  const rgb = picture.rgb(p), luminance = picture.luminance(p);
  const [x, y, z] = picture.primaries.to_xyz.map(
    (row) => row[0] * rgb[0] + row[1] * rgb[1] + row[2] * rgb[2]);
  const sum = x + 15 * y + 3 * z;
  return {
    rgb, nits: luminance * white,
    stops: luminance > 0 ? Math.log2(luminance) : null,
    uv: sum > 1e-9 ? [4 * x / sum, 9 * y / sum] : null,
  };
}

export const short = (value) =>
  Math.abs(value) >= 100 ? value.toFixed(0) : Math.abs(value) >= 10 ? value.toFixed(1)
    : Math.abs(value) >= 0.1 ? value.toFixed(2) : value === 0 ? "0" : value.toPrecision(2);
