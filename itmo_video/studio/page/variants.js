// A contact sheet of variants to choose from: all presets, or one setting at six values.

import { draw } from "viewer/draw.js";
import { attempt, get, Stale } from "./api.js";
import { committed, edit } from "./edits.js";
import { target } from "./settings.js";
import { failed, peak, S } from "./store.js";
import { pause } from "./transport.js";

const byId = (id) => document.getElementById(id);
let turn = 0;

// All for one peak, the highest of all, so that they can be compared.
function paint(tiles) {
  const most = Math.max(peak(), ...tiles.map((tile) => tile.peak));
  for (const { canvas, picture } of tiles)
    draw(canvas, [{ picture, view: "picture", from: 0, to: 1, gain: 2 ** S.exposure.hdr,
      toneMap: S.toneMap }], { white: S.state.document.settings.white_nits, peak: most });
}

async function fill() {
  const mine = ++turn, sheet = byId("sheet");
  const [width] = S.about.size, scale = width > 1000 ? 4 : width > 480 ? 2 : 1;
  const place = target(), { shot } = place, { index } = S;
  byId("variants-title").textContent = shot === null ? "Variants of this frame"
    : `Variants of this frame, for shot ${shot + 1}`;
  sheet.replaceChildren();
  sheet.setAttribute("aria-busy", "true");
  const tiles = [];
  const list = await get(`api/variants?by=${byId("vary").value}${shot === null ? "" : `&shot=${shot}`}`);
  if (mine !== turn) return;
  for (const { label, says, preset, values: asked, is_current: isCurrent } of list) {
    const button = document.createElement("button"), canvas = document.createElement("canvas");
    const name = document.createElement("b"), text = document.createElement("small");
    name.textContent = label;
    if (isCurrent) button.setAttribute("aria-current", "true");
    text.textContent = preset ? says : "";
    button.type = "button";
    button.append(canvas, name, text);
    button.addEventListener("click", () => {
      byId("variants").close();
      edit(preset ? { do: "preset", preset, ...place } : { do: "set", values: asked, ...place });
    });
    sheet.append(button);
    try {
      const found = await attempt({ index, preset, values: asked, scale, shot }, S.about.primaries);
      if (mine !== turn) return;
      tiles.push({ canvas, ...found });
      paint(tiles);
    } catch (error) {
      if (mine !== turn) return;
      if (error instanceof Stale) continue;
      text.textContent = error.message;
      button.disabled = true;
    }
  }
  sheet.setAttribute("aria-busy", "false");
}

export function openVariants() {
  byId("vary").append(...S.about.varied.map((name) => new Option(name.replaceAll("_", " "), name)));
  byId("vary").addEventListener("change", () => fill().catch(failed));
  byId("variants-close").addEventListener("click", () => byId("variants").close());
  byId("variants").addEventListener("close", () => { turn++; });
  byId("open-variants").addEventListener("click", showVariants);
}

// Of one frame, with all that was typed before.
export async function showVariants() {
  pause();
  if (!(await committed())) return;
  byId("variants").showModal();
  fill().catch(failed);
}
