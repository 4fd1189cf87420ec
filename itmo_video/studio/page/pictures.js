// A cache of pictures by frame and settings, bounded in size; never shows an outdated one.

import { picture, Stale } from "./api.js";
import { refresh, S, shotAt } from "./store.js";

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

// The key of what a picture depends on, by the current state; the server must give the same.
function makerOf({ index, part }) {
  const { version, document } = S.state;
  return part === "sdr" ? (document.shots[shotAt(index)] ?? document).source : String(version);
}

const keyOf = ({ index, slot, part, scale }, maker) =>
  `${index} ${part} ${scale} ${part === "sdr" ? "" : slot} ${maker}`;

export const has = (asked) => held.get(keyOf(asked, makerOf(asked)));

// Fetches a picture {index, slot, part, scale}; newer requests in the same `lane` replace it.
export async function load(asked, lane) {
  const maker = makerOf(asked), key = keyOf(asked, maker);
  if (held.has(key)) return held.get(key);
  const found = await picture({ ...asked, lane }, S.about.primaries);
  found.picture.key = key;
  if (found.madeBy !== maker) {
    // The server has newer settings: from an edit in progress, or from another page.
    if (maker === makerOf(asked)) await refresh();
    throw new Stale();
  }
  hold(key, found.picture);
  return found.picture;
}
