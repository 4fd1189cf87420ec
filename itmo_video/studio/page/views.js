// Viewing options: view, compare, exposures, overlays, scope, zoom, and the HDR still.

import { ACES } from "viewer/aces.js";
import { file, PAGE } from "./api.js";
import { change, failed, on, S, told } from "./store.js";

const byId = (id) => document.getElementById(id);
export const VIEWS = [["picture", "Picture"], ["false", "False colour"], ["difference", "Difference"],
  ["map", "Expand Map"], ["gain", "Gain"]];
export const COMPARES = [["hdr", "HDR"], ["sdr", "SDR"], ["split", "SDR | HDR"], ["b", "B"], ["ab", "B | A"]];

export function setView(view) { change({ view }, "view"); }

export function compare(how) {
  if ((how === "b" || how === "ab") && !S.state.other) {
    told("There is no B yet: keep the current settings as B first (Shift+B).", true);
    return;
  }
  const values = { hdr: { split: "off", only: "hdr", slot: "a" }, sdr: { split: "off", only: "sdr", slot: "a" },
    split: { split: "sdr", slot: "a" }, b: { split: "off", only: "hdr", slot: "b" },
    ab: { split: "b", slot: "a" } }[how];
  change(values, "view");
}

export const compared = () => (S.split === "sdr" ? "split" : S.split === "b" ? "ab"
  : S.slot === "b" ? "b" : S.only);

export function expose(side, by) {
  const value = by === null ? 0 : Math.min(6, Math.max(-8, S.exposure[side] + by));
  S.exposure = { ...S.exposure, [side]: Math.round(value * 10) / 10 };
  change({}, "view");
}

export const flip = (name) => change({ [name]: !S[name] }, "view");
export const zoom = () => change({ zoom: S.zoom === "fit" ? "full" : "fit" }, "view");
export const tone = () => change({ toneMap: S.toneMap === "clip" ? "bt2390" : "clip" }, "view");
const SCOPES = ["waveform", "histogram", "vectorscope"];
export const nextScope = () =>
  change({ scope: SCOPES[(SCOPES.indexOf(S.scope) + 1) % 3] }, "view");

// The frame as an AVIF in PQ, which a browser on an HDR display shows as HDR. It is dropped once
// anything else is to be seen, also while it is on its way.
let stills = 0, isComing = false;
export async function showStill() {
  const image = byId("still");
  if (!image.hidden) { dropStill(); return; }
  document.dispatchEvent(new Event("studio-pause"));
  const mine = ++stills;
  isComing = true;
  told("Rendering an HDR still …");
  try {
    const url = URL.createObjectURL(await file(
      `api/still.avif?index=${S.index}&slot=${S.slot}&page=${PAGE}&v=${S.state.version}`));
    if (mine === stills) image.src = url;
    const isShown = mine === stills && await image.decode().then(() => true, () => false);
    URL.revokeObjectURL(url);
    if (mine !== stills) return;
    isComing = false;
    if (!isShown) return told("This browser cannot show HDR stills (AVIF).", true);
    image.hidden = false;
    update();
    told(hasHdr() ? "HDR still (AVIF, PQ), shown as HDR."
      : `HDR still (AVIF, PQ). ${NOT_HDR}`);
  } catch (error) {
    if (mine !== stills) return;
    isComing = false;
    failed(error);
  }
}
function dropStill() {
  const image = byId("still");
  if (image.hidden && !isComing) return;
  stills++;
  if (isComing) told("");
  isComing = false;
  image.hidden = true;
  image.removeAttribute("src");
  update();
}
const NOT_HDR = "This display is not HDR, and the browser may show the still wrongly.";
const hasHdr = () => window.matchMedia("(dynamic-range: high)").matches;

function radios(element, list, name, onChoose) {
  element.append(...list.map(([value, label]) => {
    const input = Object.assign(document.createElement("input"), { type: "radio", name, value });
    const box = document.createElement("label");
    input.addEventListener("change", () => onChoose(value));
    box.append(input, label);
    return box;
  }));
}

function update() {
  for (const [name, value] of [["view", S.view], ["compare", compared()]])
    for (const input of document.getElementsByName(name)) input.checked = input.value === value;
  for (const side of ["hdr", "sdr"]) {
    byId(`exposure-${side}`).value = S.exposure[side];
    const stops = S.exposure[side];
    byId(`exposure-${side}-told`).textContent = `${stops > 0 ? "+" : ""}${stops.toFixed(1)} EV`;
  }
  for (const name of ["mask", "lights"]) byId(name).setAttribute("aria-pressed", String(S[name]));
  byId("tone-map").value = S.toneMap;
  byId("scope-kind").value = S.scope;
  byId("zoom").textContent = S.zoom === "fit" ? "Fit" : "100 %";
  byId("hdr-still").setAttribute("aria-pressed", String(!byId("still").hidden));
  byId("hdr-still").title = hasHdr() ? "Show this frame in true HDR (H)"
    : `Show this frame as an HDR still. ${NOT_HDR} (H)`;
}

export function openViews() {
  radios(byId("views"), VIEWS, "view", setView);
  radios(byId("compares"), COMPARES, "compare", compare);
  for (const side of ["hdr", "sdr"]) {
    const input = byId(`exposure-${side}`);
    input.addEventListener("input", () => {
      S.exposure = { ...S.exposure, [side]: Number(input.value) };
      change({}, "view");
    });
    input.addEventListener("dblclick", () => expose(side, null));
  }
  for (const name of ["mask", "lights"]) byId(name).addEventListener("click", () => flip(name));
  if (ACES) byId("tone-map").add(new Option("ACES 2.0, SDR", "aces"));
  byId("tone-map").addEventListener("change", (e) => change({ toneMap: e.target.value }, "view"));
  byId("scope-kind").addEventListener("change", (e) => change({ scope: e.target.value }, "view"));
  byId("zoom").addEventListener("click", zoom);
  byId("hdr-still").addEventListener("click", showStill);
  on("view", update);
  on("frame look view", dropStill);
  update();
}
