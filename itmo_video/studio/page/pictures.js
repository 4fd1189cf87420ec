// Pictures by frame and settings: held up to a size, and never an old one after a newer.

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

// How much smaller a picture is shown at first, and while playing.
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

// A picture {index, slot, part, scale}; `lane` is where it may be overtaken.
export async function load(asked, lane) {
  const key = keyOf(asked), version = S.state.version;
  if (held.has(key)) return held.get(key);
  const found = await picture({ ...asked, lane }, S.about.primaries);
  found.picture.key = key;
  // The server answers by the settings that it has now: perhaps newer ones than were asked for.
  if (asked.part !== "sdr" && found.version !== version) throw new Stale();
  hold(key, found.picture);
  return found.picture;
}
