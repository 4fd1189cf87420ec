// Playback: every frame is shown, at the clip's rate if rendering keeps up; loops are cached.

import { ready, show, showHeld } from "./stage.js";
import { change, emit, failed, on, S, told } from "./store.js";
import { Stale } from "./api.js";

const byId = (id) => document.getElementById(id);
const AHEAD = 24;
let run = 0;

const range = () => S.loop || [0, S.about.frames - 1];

function after(index, step) {
  const [first, last] = range(), next = index + step;
  if (next > last) return S.loop ? first : null;
  return next < first ? (S.loop ? last : null) : next;
}

// Loads upcoming frames, one request at a time.
async function feed(mine) {
  let next = S.index;
  while (mine === run) {
    const distance = Math.abs(next - S.index) / Math.abs(S.playing || 1);
    const size = range()[1] - range()[0] + 1;
    if (distance > AHEAD && size > AHEAD) { await new Promise((done) => setTimeout(done, 20)); continue; }
    try {
      await ready(next, "play");
    } catch (error) {
      if (!(error instanceof Stale)) { pause(); failed(error); return; }
    }
    const following = after(next, S.playing);
    if (following === null) return;
    next = following;
    await new Promise((done) => setTimeout(done, 0));
  }
}

export function play(step) {
  const mine = ++run;
  change({ playing: step }, "play");
  if (S.loop && (S.index < S.loop[0] || S.index > S.loop[1])) S.index = S.loop[0];
  let due = performance.now(), shownCount = 0, counted = due;
  feed(mine);
  const tick = () => {
    if (mine !== run) return;
    const now = performance.now();
    if (now >= due) {
      const next = after(S.index, S.playing);
      if (next === null) return pause();
      if (showHeld(next)) {
        S.index = next;
        emit("frame");
        shownCount++;
        due = Math.max(due + 1000 / S.about.rate, now - 50);
      }
    }
    if (now - counted > Math.max(1000, 3000 / S.about.rate)) {
      told(`Playing at ${(shownCount / (now - counted) * 1000).toFixed(1)} of `
        + `${S.about.rate.toFixed(2)} fps${S.loop ? ", looping" : ""}`);
      shownCount = 0;
      counted = now;
    }
    requestAnimationFrame(tick);
  };
  tick();
}

export function pause() {
  run++;
  if (!S.playing) return;
  change({ playing: 0 }, "play");
  told("");
  show();
}

export const toggle = () => (S.playing ? pause() : play(1));
// J and L: pressing again doubles the speed.
export const shuttle = (sign) =>
  play(Math.sign(S.playing) === sign ? Math.min(8, Math.abs(S.playing) * 2) * sign : sign);

// A loop of two seconds around the frame, within its shot.
export function loopHere() {
  if (S.loop) { S.loop = null; emit("state"); return; }
  const half = Math.max(1, Math.round(S.about.rate)), last = S.about.frames - 1;
  const shot = S.state.document.shots.find((s) =>
    s.first <= S.index + S.about.first_number && S.index + S.about.first_number <= s.last);
  const low = shot ? shot.first - S.about.first_number : 0;
  const high = shot ? shot.last - S.about.first_number : last;
  const first = Math.max(low, Math.min(S.index - half, high - 2 * half + 1));
  S.loop = [first, Math.min(high, first + 2 * half - 1)];
  emit("state");
  play(1);
}

export function openTransport() {
  byId("play").addEventListener("click", toggle);
  byId("loop").addEventListener("click", loopHere);
  document.addEventListener("studio-pause", pause);
  on("play state", () => {
    byId("play").setAttribute("aria-pressed", String(Boolean(S.playing)));
    byId("play").firstElementChild.textContent = S.playing ? "❚❚" : "▶";
    byId("loop").setAttribute("aria-pressed", String(Boolean(S.loop)));
  });
  // New settings restart the loop, as cached frames were rendered with the old ones.
  on("look view", () => { if (S.playing) play(S.playing); });
}
