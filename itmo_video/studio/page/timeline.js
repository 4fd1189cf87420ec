// The timeline: shots as blocks, keyframes as ticks, cuts, the loop, and the playhead.

import { edit, placeAt } from "./edits.js";
import { emit, number, on, S, shotAt, told } from "./store.js";
import { go } from "./stage.js";

const byId = (id) => document.getElementById(id);
const COLOURS = { shot: "#3a4652", other: "#32393f", now: "#4f6a80", own: "#56b4e9", off: "#242424" };
let canvas;

const toX = (index, width) => index / S.about.frames * width;
const toIndex = (x, width) => Math.min(S.about.frames - 1, Math.max(0, Math.floor(x / width * S.about.frames)));

function draw() {
  const ratio = window.devicePixelRatio || 1;
  const width = Math.round(canvas.clientWidth * ratio), height = Math.round(canvas.clientHeight * ratio);
  if (!width) return;
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  const c = canvas.getContext("2d"), first = S.about.first_number;
  c.fillStyle = "#141414";
  c.fillRect(0, 0, width, height);
  const { document: { shots } } = S.state, top = 16 * ratio, bottom = height - 10 * ratio;
  const blocks = shots.length ? shots : [{ first, last: first + S.about.frames - 1, enabled: true, own: {} }];
  const now = shotAt(S.index);
  c.font = `${11 * ratio}px system-ui, sans-serif`;
  blocks.forEach((shot, i) => {
    const left = toX(shot.first - first, width), right = toX(shot.last + 1 - first, width);
    c.fillStyle = !shot.enabled ? COLOURS.off : i === now ? COLOURS.now : i % 2 ? COLOURS.other : COLOURS.shot;
    c.fillRect(left + ratio / 2, top, Math.max(1, right - left - ratio), bottom - top);
    if (Object.keys(shot.own).length) {
      c.fillStyle = COLOURS.own;
      c.fillRect(left + ratio / 2, top, Math.max(1, right - left - ratio), 3 * ratio);
    }
    if (right - left > 34 * ratio) {
      c.fillStyle = shot.enabled ? "#d5d5d5" : "#8a8a8a";
      c.fillText(`${i + 1}${shot.enabled ? "" : " SDR"}`, left + 6 * ratio, top + 18 * ratio);
    }
  });
  c.fillStyle = "#8b8b8b";
  if (S.state.keys.length < width / 3)
    for (const key of S.state.keys)
      c.fillRect(Math.round(toX(key - first + 0.5, width)), bottom + 2 * ratio, ratio, 5 * ratio);
  if (S.loop) {
    c.fillStyle = "#f0e442";
    const left = toX(S.loop[0], width), right = toX(S.loop[1] + 1, width);
    c.fillRect(left, bottom + 2 * ratio, right - left, 3 * ratio);
  }
  const every = tickStep(width / ratio);
  c.fillStyle = "#9a9a9a";
  for (let n = Math.ceil(first / every) * every; n < first + S.about.frames; n += every)
    c.fillText(`${n}`, toX(n - first, width) + 3 * ratio, 11 * ratio);
  const x = toX(S.index + 0.5, width);
  c.fillStyle = "#fff";
  c.fillRect(Math.round(x - ratio), 0, 2 * ratio, height);
  c.beginPath();
  c.moveTo(x - 6 * ratio, 0); c.lineTo(x + 6 * ratio, 0); c.lineTo(x, 9 * ratio);
  c.fill();
}

function tickStep(width) {
  const least = S.about.frames / Math.max(1, width / 64);
  return [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000, 20000, 50000]
    .find((step) => step >= least) || 100000;
}

function tell() {
  const at = shotAt(S.index), shots = S.state.document.shots;
  const time = (S.index / S.about.rate).toFixed(2);
  byId("frame-number").value = number(S.index);
  byId("frame-of").textContent = `of ${number(S.about.frames - 1)} · ${time} s`
    + (at >= 0 ? ` · shot ${at + 1} of ${shots.length}` : "");
  canvas.setAttribute("aria-valuenow", number(S.index));
  canvas.setAttribute("aria-valuetext", `frame ${number(S.index)}${at >= 0 ? `, shot ${at + 1}` : ""}`);
  byId("cuts-state").textContent = S.state.analysis_error ? S.state.analysis_error
    : S.state.is_analysed ? "" : `finding cuts: ${Math.floor(100 * S.state.analysed / S.about.frames)} %`;
  const shot = shots[at];
  for (const id of ["split-shot", "merge-shot", "enable-shot"]) byId(id).disabled = !shot;
  if (!shot) return;
  byId("split-shot").disabled = number(S.index) === shot.first;
  byId("merge-shot").disabled = at === shots.length - 1;
  byId("enable-shot").setAttribute("aria-pressed", String(!shot.enabled));
}

export const splitHere = () => edit({ do: "split", at: number(S.index) });
export const mergeHere = () => edit({ do: "merge", ...placeAt(S.index) });
export function switchHere() {
  const at = shotAt(S.index);
  if (at >= 0) edit({ do: "enable", ...placeAt(S.index), on: !S.state.document.shots[at].enabled });
}

// The first frame of the next shot, or of this or the previous one.
export function cut(by) {
  const starts = S.state.document.shots.map((shot) => shot.first - S.about.first_number);
  const found = by > 0 ? starts.find((i) => i > S.index) : starts.findLast((i) => i < S.index);
  go(found ?? (by > 0 ? S.about.frames - 1 : 0));
}

export function markLoop(which) {
  const [from, to] = S.loop || [0, S.about.frames - 1];
  S.loop = which === "in" ? [S.index, Math.max(S.index, to)]
    : which === "out" ? [Math.min(from, S.index), S.index] : null;
  draw();
  emit("state");
}

export function openTimeline() {
  canvas = byId("timeline");
  canvas.setAttribute("aria-valuemin", number(0));
  canvas.setAttribute("aria-valuemax", number(S.about.frames - 1));
  const scrub = (e) => go(toIndex(e.clientX - canvas.getBoundingClientRect().left, canvas.clientWidth));
  canvas.addEventListener("pointerdown", (e) => {
    canvas.setPointerCapture(e.pointerId);
    if (S.playing) document.dispatchEvent(new Event("studio-pause"));
    scrub(e);
  });
  canvas.addEventListener("pointermove", (e) => { if (e.buttons & 1) scrub(e); });
  byId("frame-number").addEventListener("change", ({ target: field }) => {
    const asked = field.value;
    if (/^\d+$/.test(asked)) return go(Number(asked) - S.about.first_number);
    tell();
    told(asked ? `There is no frame ${asked}: frame numbers are whole numbers.` : "Type a frame's number.", true);
  });
  byId("frame-number").addEventListener("keydown", (e) => { if (e.key === "Enter") e.target.blur(); });
  byId("split-shot").addEventListener("click", splitHere);
  byId("merge-shot").addEventListener("click", mergeHere);
  byId("enable-shot").addEventListener("click", switchHere);
  new ResizeObserver(draw).observe(canvas);
  on("frame state", () => { draw(); tell(); });
  draw();
  tell();
}
