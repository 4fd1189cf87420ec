// A cache of pictures by frame and settings, bounded in size; never shows an outdated one.

import { picture, Stale } from "./api.js";
import { S } from "./store.js";

const MOST_BYTES = 512 << 20, SMALL_PIXELS = 700_000;
const held = new Map();
let bytes = 0;

function hold(key, value) {
  held.set(key, value);
  bytes += value.codes.byteLength;
  for (const [old, { codes }] of held) {
    if (bytes <= MOST_BYTES || old === key) break;
    held.delete(old);
    bytes -= codes.byteLength;
  }
}

// The scale of a picture's first, quick version, also used while playing.
export function quickScale() {
  const [width, height] = S.about.size, pixels = width * height;
  return pixels > 4 * SMALL_PIXELS ? 4 : pixels > SMALL_PIXELS ? 2 : 1;
}

function keyOf({ index, slot, part, scale }) {
  const { version, document: { settings: s } } = S.state;
  const look = part === "sdr" ? `${s.transfer} ${s.matrix} ${s.range} ${s.over_white}` : version;
  return `${index} ${part} ${scale} ${part === "sdr" ? "" : slot} ${look}`;
}

export const has = (asked) => held.get(keyOf(asked));

// Fetches a picture {index, slot, part, scale}; newer requests in the same `lane` replace it.
export async function load(asked, lane) {
  const key = keyOf(asked), version = S.state.version;
  if (held.has(key)) return held.get(key);
  const found = await picture({ ...asked, lane }, S.about.primaries);
  found.picture.key = key;
  // The server renders with its current settings, which may be newer than those requested.
  if (asked.part !== "sdr" && found.version !== version) throw new Stale();
  hold(key, found.picture);
  return found.picture;
}
