// The settings as controls, each generated from its definition; for the clip or for one shot.

import { control } from "./control.js";
import { edit, pending, placeAt, placeOf } from "./edits.js";
import { change, on, S } from "./store.js";

const byId = (id) => document.getElementById(id);
const OPEN = new Set(["Look", "Expand Map"]);
const made = new Map();
let gesture = 0;

// What the controls set: the clip (shot null) or the shot of this frame. It stays the same from the
// moment a field is entered or a slider is taken until it is left, wherever the frame goes meanwhile.
let held = null;
const holders = new Set();
const current = () => (S.scope_of === "shot" ? placeAt(S.index) : placeOf(null));
export const target = () => held ?? current();

function hold(holder) {
  held ??= current();
  holders.add(holder);
}
function release(holder) {
  if (!holders.delete(holder) || holders.size) return;
  held = null;
  update();
}

const FIELDS = "input[type=number], input:not([type]), select";
function holdWhileEditing(panel) {
  panel.addEventListener("focusin", ({ target: t }) => { if (t.matches(FIELDS)) hold("field"); });
  panel.addEventListener("focusout", () => release("field"));
  // A list that is closed keeps the focus, but no longer edits.
  panel.addEventListener("change", ({ target: t }) => { if (t.matches("select")) release("field"); });
  panel.addEventListener("pointerdown", ({ target: t }) => { if (!t.matches("select")) hold("pointer"); });
  for (const end of ["pointerup", "pointercancel"])  // once its change and click are handled
    window.addEventListener(end, () => setTimeout(() => release("pointer")));
}

// What is set here, with what is being sent.
function own() {
  const { shot } = target(), { document } = S.state;
  const said = { ...(shot === null ? document.changed : document.shots[shot]?.own), ...pending(shot) };
  return Object.fromEntries(Object.entries(said).filter(([, value]) => value !== null));
}

// All moves of one drag are one undo step; its end starts a new one.
function set(name, value, isDrag) {
  const place = target();
  if (place.shot === -1) return;
  edit({ do: "set", values: { [name]: value }, ...place, gesture: `${place.shot} ${name} ${gesture}` });
  if (!isDrag) gesture++;
  update();
}

function build() {
  const groups = new Map();
  for (const spec of S.about.controls) {
    if (!groups.has(spec.group)) groups.set(spec.group, []);
    groups.get(spec.group).push(spec);
  }
  byId("settings").replaceChildren(...[...groups].map(([name, specs]) => {
    const group = document.createElement("details"), title = document.createElement("summary");
    group.open = OPEN.has(name);
    title.textContent = name;
    group.append(title, ...specs.map((spec) => {
      const one = control(spec, (value, isDrag) => set(spec.name, value, isDrag));
      made.set(spec.name, one);
      return one.element;
    }));
    return group;
  }));
}

function update() {
  const { document: { preset }, document } = S.state;
  const { shot } = target(), mine = own();
  const settings = (shot === null ? null : document.shots[shot]?.settings) ?? document.settings;
  const most = settings.l_max ?? settings.peak_nits / settings.white_nits;
  const derived = { l_max: most, l_white: most, peak_nits: settings.peak_nits };
  for (const spec of S.about.controls) {
    const one = made.get(spec.name);
    const value = spec.name in mine ? mine[spec.name] : settings[spec.name];
    const isOff = shot !== null && (!spec.of_shots || shot < 0);
    one.update({ value, derived: derived[spec.name], changed: spec.name in mine, disabled: isOff,
      operator: S.about.operators.find((o) => o.name === settings.operator) });
  }
  const named = mine.preset ?? preset;
  byId("preset").value = named;
  const about = S.about.presets.find((p) => p.name === named);
  byId("preset-says").textContent = about ? about.description : `from ${preset}`;
  const place = shot ?? placeAt(S.index).shot;
  byId("of-shot").disabled = place < 0;
  byId("of-shot").textContent = place < 0 ? "This shot" : `Shot ${place + 1}`;
  for (const name of ["clip", "shot"])
    byId(`of-${name}`).setAttribute("aria-pressed", String(S.scope_of === name));
  byId("scope-says").textContent = S.scope_of === "shot"
    ? "Settings of this shot only; dimmed ones apply to the whole clip." : "";
  byId("undo").disabled = !S.state.can_undo;
  byId("redo").disabled = !S.state.can_redo;
}

export const setPreset = (preset) => edit({ do: "preset", preset, ...target() });

export function resetAll() {
  const names = Object.keys(own()).filter((name) => made.has(name) || name === "preset");
  const values = Object.fromEntries(names.map((name) => [name, null]));
  if (Object.keys(values).length) edit({ do: "set", values, ...target() });
}

export function openSettings() {
  const names = S.about.presets.map(({ name }) => name);
  if (!names.includes(S.state.document.preset)) names.push(S.state.document.preset);
  byId("preset").replaceChildren(...names.map((name) => new Option(name, name)));
  byId("preset").addEventListener("change", (e) => setPreset(e.target.value));
  byId("of-clip").addEventListener("click", () => change({ scope_of: "clip" }, "state"));
  byId("of-shot").addEventListener("click", () => change({ scope_of: "shot" }, "state"));
  byId("reset-all").addEventListener("click", resetAll);
  build();
  for (const part of ["settings", "preset", "reset-all"]) holdWhileEditing(byId(part));
  on("frame state", update);
  update();
}
