// Shows the frame: fetches the pictures that the view needs, small first, and draws them.

import { draw } from "viewer/draw.js";
import { bands, legend } from "viewer/false_colour.js";
import { probe, short } from "viewer/light.js";
import { drawScope } from "viewer/scopes.js";
import { Screen } from "viewer/screen.js";
import { get, PAGE, Stale } from "./api.js";
import { has, load, quickScale } from "./pictures.js";
import { busy, change, failed, number, on, peak, S } from "./store.js";
import { compared } from "./views.js";

const byId = (id) => document.getElementById(id);
const LAYERS = { map: "expand_map", gain: "gain" };
let screen, turn = 0, shown = null, drawing = 0, lit = null;

// SDR white in nits, of A or of B.
const whiteOf = (slot) =>
  ((slot === "b" ? S.state.other : null) ?? S.state.document).settings.white_nits;

// The pictures that the current view consists of, by role.
function needs(index, scale) {
  const slot = S.slot, wanted = {};
  const other = S.split === "b" ? { slot: "b", part: "hdr" } : { slot: "a", part: "sdr" };
  wanted.main = S.only === "sdr" && S.split === "off"
    ? { slot: "a", part: "sdr" } : { slot, part: "hdr" };
  if (S.split !== "off" || S.view === "difference") wanted.other = other;
  if (LAYERS[S.view]) wanted.layer = { slot, part: LAYERS[S.view] };
  if (S.mask) wanted.mask = { slot, part: "clip_mask" };
  return Object.fromEntries(
    Object.entries(wanted).map(([role, asked]) => [role, { index, scale, ...asked }]));
}

const laneOf = ({ part, slot }) => part === "sdr" ? "sdr" : part === "hdr" ? slot : "layer";

async function gathered(wanted, lane = null) {
  const found = {}, lanes = new Map();
  for (const [role, asked] of Object.entries(wanted)) {
    const name = lane || laneOf(asked);
    lanes.set(name, [...(lanes.get(name) ?? []), [role, asked]]);
  }
  // One after the other within a lane, where the later request would replace the earlier one.
  await Promise.all([...lanes].map(async ([name, list]) => {
    for (const [role, asked] of list) found[role] = await load(asked, name);
  }));
  return found;
}

export async function show() {
  const mine = ++turn, index = S.index, quick = quickScale();
  const began = performance.now();
  busy("frame", true);
  fetchLights();
  try {
    const isThere = Object.values(needs(index, 1)).every(has);
    for (const scale of quick > 1 && !isThere ? [quick, 1] : [1]) {
      const { version } = S.state, found = await gathered(needs(index, scale));
      if (mine !== turn) return;
      shown = { ...found, index, scale, version, turn: mine };
      paint();
      byId("stage").dataset.ms = Math.round(performance.now() - began);
      if (S.playing) return;
    }
  } catch (error) {
    // A request replaced by one of the same turn (another view) is sent again.
    if (error instanceof Stale) { if (mine === turn) setTimeout(() => mine === turn && show(), 30); }
    else { busy("frame", false); failed(error); }
  }
}

// Shows a frame while playing; true if it could be shown at once.
export async function ready(index, lane) {
  await gathered(needs(index, quickScale()), lane);
}
export function showHeld(index) {
  const wanted = needs(index, quickScale()), found = {};
  for (const [role, asked] of Object.entries(wanted)) {
    found[role] = has(asked);
    if (!found[role]) return false;
  }
  turn++;
  shown = { ...found, index, scale: quickScale(), version: S.state.version, turn };
  paint();
  return true;
}

function sides() {
  const { main, other, layer, mask } = shown;
  const gainOf = (role) => 2 ** S.exposure[role];
  const isSdr = S.only === "sdr" && S.split === "off";
  const right = {
    picture: main, other, layer, mask, view: S.view, from: 0, to: 1,
    white: whiteOf(S.slot), gain: gainOf(isSdr ? "sdr" : "hdr"), toneMap: isSdr ? "clip" : S.toneMap,
  };
  if (S.split === "off" || !other) return [right];
  const isB = S.split === "b", view = S.view === "false" ? "false" : "picture";
  const left = { picture: other, view, from: 0, to: screen.split, mask: null,
    white: whiteOf(isB ? "b" : "a"),
    gain: gainOf(isB ? "hdr" : "sdr"), toneMap: isB ? S.toneMap : "clip" };
  return [left, { ...right, from: screen.split }];
}

// Schedules one redraw, however often it is called.
export function paint() {
  busy("drawing", true);
  cancelAnimationFrame(drawing);
  drawing = requestAnimationFrame(() => {
    busy("drawing", false);
    if (!shown) return;
    const began = performance.now();
    const white = whiteOf(S.slot);
    draw(byId("picture"), sides(), { white, scaleWhite: white, peak: peak() });
    const stage = byId("stage");
    Object.assign(stage.dataset, { frame: number(shown.index), scale: shown.scale,
      version: shown.version, draw: Math.round(performance.now() - began), view: S.view,
      compare: compared(), tone: S.toneMap, mask: S.mask, exposures: [S.exposure.sdr, S.exposure.hdr] });
    screen.shows = { divider: S.split !== "off", lights: S.lights && !S.playing };
    screen.mark();
    labels(white);
    tell();
    if (!S.playing) scope(white);
    if (shown.turn === turn && (shown.scale === 1 || S.playing)) busy("frame", false);
  });
}

function scope(white) {
  drawScope(byId("scope"), S.scope, shown.main, white);
}

function labels(white) {
  const left = byId("left-label"), right = byId("right-label");
  left.hidden = S.split === "off";
  left.textContent = S.split === "b" ? "B" : "SDR";
  right.textContent = S.split === "off" && S.only === "sdr" ? "SDR"
    : S.slot === "b" ? "B" : S.split === "b" ? "A" : "HDR";
  byId("legend").hidden = S.view !== "false";
  if (S.view === "false") legend(byId("legend"), bands(white, peak() * white), short);
  byId("quality").textContent = shown.scale === 1 ? "full size" : `1/${shown.scale} size`;
}

function tell() {
  const out = byId("probe");
  if (!screen.probe || !shown) return;
  const { main, other } = shown;
  const [x, y] = screen.probe;
  const line = (name, picture, white) => {
    const told = probe(picture, picture.at(x, y), white);
    const stops = told.stops === null ? "black"
      : `${told.stops >= 0 ? "+" : "−"}${Math.abs(told.stops).toFixed(2)} stops`;
    const uv = told.uv ? `u′v′ ${told.uv.map((v) => v.toFixed(4)).join(" ")}` : "";
    return [name, `${short(told.nits)} nits`, stops, uv, told];
  };
  const rows = [line(byId("right-label").textContent, main, whiteOf(S.slot))];
  if (other) rows.push(S.split === "b" ? line("B", other, whiteOf("b")) : line("SDR", other, whiteOf("a")));
  Object.assign(out.dataset, { nits: rows[0][4].nits, rgb: rows[0][4].rgb.join(","),
    x: Math.floor(x * main.width), y: Math.floor(y * main.height), scale: shown.scale });
  out.replaceChildren(...rows.map((cells) => {
    const row = document.createElement("div");
    row.append(...cells.slice(0, 4).map((text) => {
      const cell = document.createElement("span");
      cell.textContent = text;
      return cell;
    }));
    return row;
  }));
}

// The lights of the frame shown, and of no other: not while playing, and no late answer.
async function fetchLights() {
  const { index, slot } = S, asked = `${index} ${slot} ${S.state.version}`;
  if (!S.lights || S.playing || lit === asked) return;
  lit = asked;
  screen.lights = [];
  delete byId("stage").dataset.lights;
  try {
    const found = await get(`api/lights?index=${index}&slot=${slot}&page=${PAGE}`);
    if (lit !== asked) return;
    screen.lights = found;
    byId("stage").dataset.lights = number(index);
    screen.mark();
  } catch (error) {
    if (lit === asked) lit = null;
    failed(error);
  }
}

export function openStage() {
  screen = new Screen({
    box: byId("box"), canvas: byId("picture"), overlay: byId("overlay"), divider: byId("divider"),
    size: S.about.size, aspect: S.about.pixel_aspect, onProbe: tell, onDivide: paint,
  });
  const [width, height] = S.about.size;
  byId("box").style.setProperty("--aspect", width * S.about.pixel_aspect / height);
  on("frame look", () => { if (!S.playing) show(); });
  on("view", () => { if (!S.playing) show(); else paint(); screen.setZoom(S.zoom); });
  new ResizeObserver(() => shown && paint()).observe(byId("scope"));
  show();
}

export const divide = (by) => { if (S.split !== "off") screen.divide(screen.split + by); };
export const go = (index) => {
  const last = S.about.frames - 1;
  change({ index: Math.min(last, Math.max(0, index)) }, "frame");
};
