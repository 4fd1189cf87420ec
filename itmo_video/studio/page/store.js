// The page's state: facts, the document, and the view; listeners are notified of changes.

import { get, Refused, Stale } from "./api.js";

export const S = {
  about: null, state: null,
  index: 0,                       // the frame shown, from 0
  view: "picture", split: "off",  // split: off, sdr, b
  slot: "a", only: "hdr",         // the whole picture: hdr or sdr
  exposure: { hdr: 0, sdr: 0 },
  toneMap: "bt2390", mask: false, lights: false, scope: "waveform", zoom: "fit",
  scope_of: "clip",               // what the controls set: clip or shot
  playing: 0, loop: null,         // frames per step; [first, last] indices
};

const listeners = {};
export function on(events, listener) {
  for (const event of events.split(" ")) (listeners[event] ||= []).push(listener);
}
export function emit(event) {
  for (const listener of listeners[event] || []) listener();
}

// Events: frame (another frame), look (settings), view (viewing options), state (all else).
export function change(values, event) {
  Object.assign(S, values);
  if (event === "frame") forgiven();
  emit(event);
}

export function told(text, isError = false) {
  const line = document.getElementById("status");
  line.textContent = text.replace(/([^.:!?])\n/g, "$1. ");
  line.classList.toggle("error", isError);
}

// A refusal is cleared once something else is shown.
function forgiven() {
  if (document.getElementById("status").classList.contains("error")) told("");
}

export function failed(error) {
  if (error instanceof Stale) return;
  if (error instanceof Refused) told(error.message, true);
  else { told(`The page failed: ${error.message}`, true); throw error; }
}

// The other pages of this studio that are open here.
const others = new BroadcastChannel("studio");
others.addEventListener("message", ({ data: version }) => {
  if (S.state && version > S.state.version) refresh().catch(failed);
});

export function take(state) {
  const before = S.state;
  if (before && state.version < before.version) return;  // an outdated response
  S.state = state;
  if (before?.version !== state.version) others.postMessage(state.version);
  emit("state");
  if (!before || before.version !== state.version) emit("look");
}

export async function refresh() {
  take(await get("api/state"));
}

// What is under way for the picture: edits that are not answered, a frame that is not drawn. The
// stage is busy until nothing is.
const underWay = new Set();
export function busy(what, isBusy) {
  underWay[isBusy ? "add" : "delete"](what);
  document.getElementById("stage").setAttribute("aria-busy", String(underWay.size > 0));
}

export const number = (index) => index + S.about.first_number;
export const shotAt = (index) =>
  S.state.document.shots.findIndex((s) => s.first <= number(index) && number(index) <= s.last);
// One peak for all pictures compared: none may change its look because another's peak changed.
export const peak = () => S.state.peak;
