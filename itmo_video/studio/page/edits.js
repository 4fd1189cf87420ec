// Edits of the document, sent one at a time and in the order in which they were made.

import { post } from "./api.js";
import { busy, emit, failed, refresh, S, shotAt, take, told } from "./store.js";

// [{body, done: [resolve]}]; the first is being sent.
const waiting = [];
let isSending = false;

// A shot as an edit names it: by its place among the shots as they are now.
export const placeOf = (shot) =>
  (shot === null ? { shot } : { shot, layout: S.state.document.layout });
export const placeAt = (index) => placeOf(shotAt(index));

const keyOf = ({ do: what, values, shot }) =>
  (what === "set" ? `${shot} ${Object.keys(values)}` : null);

// Sends an edit after all before it; true once it is made. Of values of one setting that wait next
// to each other only the last is sent.
export function edit(body) {
  return new Promise((resolve) => {
    const last = waiting.at(-1), key = keyOf(body);
    if (waiting.length > 1 && key && keyOf(last.body) === key) {
      last.body = body;
      last.done.push(resolve);
    } else waiting.push({ body, done: [resolve] });
    busy("edits", true);
    send();
  });
}

async function send() {
  if (isSending) return;
  isSending = true;
  let refused = null;
  while (waiting.length) {
    const [{ body, done }] = waiting;
    let state = null;
    try {
      state = await post("api/edit", body);
    } catch (error) {
      refused = error;
      await refresh().catch(() => {});  // the shots may be others by now
    }
    waiting.shift();
    if (state) take(state); else emit("state");
    for (const resolve of done) resolve(Boolean(state));
  }
  isSending = false;
  busy("edits", false);
  for (const resolve of idle.splice(0)) resolve(!refused);
  if (refused) failed(refused); else told("");
}

// Values that are not yet in the state, of the clip (null) or of a shot.
export function pending(shot) {
  const sets = waiting.map(({ body }) => body).filter((b) => b.do === "set" && b.shot === shot);
  return Object.assign({}, ...sets.map(({ values }) => values));
}

// Ends the typing in a field, as leaving it does, and waits until all edits are made; false if a
// value was refused, so that nothing is done without it.
const idle = [];
export async function committed() {
  const { activeElement: field } = document;
  if (field?.matches("input, select")) {
    if (!field.reportValidity()) { told(field.validationMessage, true); return false; }
    field.blur();
  }
  return waiting.length ? new Promise((resolve) => { idle.push(resolve); }) : true;
}
