// A contact sheet of variants: all presets, or one setting at six values; one is picked.

import { draw } from "viewer/draw.js";
import { attempt, Stale } from "./api.js";
import { edit, failed, peak, S } from "./store.js";

const byId = (id) => document.getElementById(id);
const COUNT = 6;
let turn = 0;

function values({ lower, upper, by_ratio, kind, name }, now) {
  const low = name === "peak_nits" ? 400 : name === "radius" ? 4 : lower;
  const high = name === "peak_nits" ? 4000 : name === "radius" ? 64 : Math.min(upper, Math.max(now * 4, low + 1));
  return Array.from({ length: COUNT }, (_, i) => {
    const part = i / (COUNT - 1);
    const value = by_ratio ? low * (high / low) ** part : low + part * (high - low);
    return kind === "int" ? Math.round(value) : Number(value.toPrecision(2));
  });
}

function lights({ lower }) {
  return Array.from({ length: COUNT }, (_, i) => 2 ** (6 + i)).filter((n) => n >= lower);
}

// What can be tried: {label, preset or values}.
function variants(by) {
  if (by === "presets")
    return S.about.presets.map((p) => ({ label: p.name, says: p.description, preset: p.name, values: {} }));
  const spec = S.about.controls.find((c) => c.name === by), { settings, peak_nits } = S.state.document;
  const now = by === "peak_nits" ? peak_nits : settings[by] ?? 1;
  const list = spec.kind === "bool" ? [false, true] : spec.choices.length ? spec.choices
    : by === "lights" ? lights(spec) : values(spec, now);
  return list.map((value) => ({ label: `${spec.label} ${value}`, says: spec.help, values: { [by]: value } }));
}

async function fill() {
  const mine = ++turn, sheet = byId("sheet");
  const [width] = S.about.size, scale = width > 1000 ? 4 : width > 480 ? 2 : 1;
  sheet.replaceChildren();
  for (const { label, says, preset = null, values: asked } of variants(byId("vary").value)) {
    const button = document.createElement("button"), canvas = document.createElement("canvas");
    const name = document.createElement("b"), text = document.createElement("small");
    name.textContent = label;
    text.textContent = preset ? says : "";
    button.type = "button";
    button.append(canvas, name, text);
    button.addEventListener("click", async () => {
      byId("variants").close();
      if (preset) await edit({ do: "preset", preset });
      else await edit({ do: "set", values: asked });
    });
    sheet.append(button);
    try {
      const picture = await attempt({ index: S.index, preset, values: asked, scale }, S.about.primaries);
      if (mine !== turn) return;
      draw(canvas, [{ picture, view: "picture", from: 0, to: 1, gain: 2 ** S.exposure.hdr,
        toneMap: S.toneMap }], { white: S.state.document.settings.white_nits, peak: peak() });
    } catch (error) {
      if (mine !== turn) return;
      if (error instanceof Stale) continue;
      text.textContent = error.message;
      button.disabled = true;
    }
  }
}

export function openVariants() {
  const able = S.about.controls.filter((c) => c.group !== "File" && c.group !== "Source"
    && (["float", "int", "bool"].includes(c.kind) || c.choices.length) && c.upper !== 1e6 || c.name === "peak_nits");
  byId("vary").append(new Option("all presets", "presets"), ...able.map((c) => new Option(c.label, c.name)));
  byId("vary").addEventListener("change", () => fill().catch(failed));
  byId("variants-close").addEventListener("click", () => byId("variants").close());
  byId("variants").addEventListener("close", () => { turn++; });
  byId("open-variants").addEventListener("click", showVariants);
}

export function showVariants() {
  byId("variants").showModal();
  fill().catch(failed);
}
