// From light to a monitor's codes: BT.1886, exposure, and curves that compress highlights.

const M1 = 2610 / 16384, M2 = 2523 / 4096 * 128;
const C1 = 3424 / 4096, C2 = 2413 / 4096 * 32, C3 = 2392 / 4096 * 32;

// PQ's code, 0 to 1, of light in nits (SMPTE ST 2084), and back.
export function pqCode(nits) {
  const y = Math.min(1, Math.max(0, nits / 10000)) ** M1;
  return ((C1 + C2 * y) / (1 + C3 * y)) ** M2;
}
export function pqNits(code) {
  const power = Math.min(1, Math.max(0, code)) ** (1 / M2);
  return 10000 * (Math.max(power - C1, 0) / (C2 - C3 * power)) ** (1 / M1);
}

// ITU-R BT.2390-10's EETF with 203 nits as the monitor's white: linear up to a knee.
function bt2390(level, peak) {
  const top = pqCode(203 * Math.max(peak, 1.0001)), largest = pqCode(203) / top;
  const e = pqCode(level * 203) / top, knee = 1.5 * largest - 0.5;
  if (e < knee) return level;
  const t = Math.min(1, (e - knee) / Math.max(1 - knee, 1e-9));
  const spline = (2 * t ** 3 - 3 * t ** 2 + 1) * knee + (t ** 3 - 2 * t ** 2 + t) * (1 - knee)
    + (-2 * t ** 3 + 3 * t ** 2) * largest;
  return pqNits(spline * top) / 203;
}

export const TONE_MAPS = {
  bt2390: { label: "Tone-mapped (BT.2390)", curve: bt2390 },
  clip: { label: "Clipped at white", curve: (level) => level },
};

// A table of 8-bit codes by picture code: light times a gain, clipped.
export function clippedTable(light, gain) {
  const table = new Uint8Array(light.length);
  for (let c = 0; c < light.length; c++)
    table[c] = 255 * Math.min(1, Math.max(0, light[c] * gain)) ** (1 / 2.4) + 0.5;
  return table;
}

// A table of factors for light, by the code of the largest of R, G and B, which keeps hue.
export function factorTable(light, gain, name, peak) {
  const table = new Float32Array(light.length), { curve } = TONE_MAPS[name];
  let last = 0, factor = gain;
  for (let c = 0; c < light.length; c++) {
    const level = light[c] * gain;
    // Neighbouring codes differ by a thousandth, so the curve is evaluated for every fourth.
    if (level > 0 && (c & 3) === 0) factor = gain * curve(level, peak * gain) / level;
    table[c] = level > 0 ? factor : gain;
    last = c;
  }
  return table;
}

// A table of 8-bit codes by the square root of light, times 4095.
export const ENCODED = Uint8Array.from(
  { length: 4096 }, (_, i) => 255 * ((i / 4095) ** 2) ** (1 / 2.4) + 0.5);

// A table of positions in ACES's table by picture code: evenly in log2 of light.
export function acesTable(light, gain, { size, lowest, highest }) {
  const floor = 2 ** lowest, scale = (size - 1) / (highest - lowest);
  return Float32Array.from(light, (value) => {
    const position = (Math.log2(Math.max(0, value * gain) + floor) - lowest) * scale;
    return Math.min(size - 1, Math.max(0, position));
  });
}
