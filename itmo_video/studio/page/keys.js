// The keyboard: every action with its keys and its description, as shown in the help.

import { committed, edit } from "./edits.js";
import { saveAll, showFiles } from "./files.js";
import { resetAll } from "./settings.js";
import { divide, go } from "./stage.js";
import { S, told } from "./store.js";
import { cut, markLoop, mergeHere, splitHere, switchHere } from "./timeline.js";
import { loopHere, pause, shuttle, toggle } from "./transport.js";
import { showVariants } from "./variants.js";
import { compare, compared, expose, flip, nextScope, setView, showStill, tone, VIEWS, zoom } from "./views.js";

const byId = (id) => document.getElementById(id);
const step = (by) => { pause(); go(S.index + by); };
const second = () => Math.max(1, Math.round(S.about.rate));
const keepB = async () => {
  if (await edit({ do: "keep_other" })) told("The current settings are kept as B.");
};

// [keys, description, action]; keys as the browser names them, prefixed with Ctrl+ and Shift+.
const KEYS = [
  ["Move", [
    [[" ", "k"], "play or pause", toggle], [["l"], "play; press again for faster", () => shuttle(1)],
    [["j"], "play backwards; press again for faster", () => shuttle(-1)],
    [["ArrowRight"], "next frame", () => step(1)], [["ArrowLeft"], "previous frame", () => step(-1)],
    [["Shift+ArrowRight"], "one second forward", () => step(second())],
    [["Shift+ArrowLeft"], "one second back", () => step(-second())],
    [["ArrowDown"], "next shot", () => cut(1)], [["ArrowUp"], "previous shot", () => cut(-1)],
    [["Home"], "first frame", () => go(0)], [["End"], "last frame", () => go(S.about.frames - 1)],
    [["p"], "loop two seconds around this frame, or stop looping", loopHere],
    [["i"], "set loop start", () => markLoop("in")], [["o"], "set loop end", () => markLoop("out")]]],
  ["Look", [
    ...VIEWS.map(([view, label], i) => [[`${i + 1}`], label.toLowerCase(), () => setView(view)]),
    [["s"], "toggle SDR and HDR", () => compare(compared() === "sdr" ? "hdr" : "sdr")],
    [["d"], "SDR | HDR, split", () => compare(compared() === "split" ? "hdr" : "split")],
    [[",", "."], "move the divider", (e) => divide(e.key === "," ? -0.02 : 0.02)],
    [["]", "["], "exposure of HDR, half a stop", (e) => expose("hdr", e.key === "]" ? 0.5 : -0.5)],
    [["}", "{"], "exposure of SDR, half a stop", (e) => expose("sdr", e.key === "}" ? 0.5 : -0.5)],
    [["0"], "reset both exposures", () => { expose("hdr", null); expose("sdr", null); }],
    [["t"], "toggle tone-mapped and clipped at white", tone], [["c"], "clip mask", () => flip("mask")],
    [["g"], "median-cut lights", () => flip("lights")], [["w"], "next scope", nextScope],
    [["f"], "toggle fit and 100 %", zoom], [["h"], "HDR still", showStill]]],
  ["Decide", [
    [["Shift+B"], "keep the current settings as B", keepB],
    [["b"], "toggle B and A", () => compare(compared() === "b" ? "hdr" : "b")],
    [["a"], "B | A, split", () => compare(compared() === "ab" ? "hdr" : "ab")],
    [["Shift+A"], "swap A and B", () => edit({ do: "swap" })],
    [["x"], "split the shot before this frame", splitHere],
    [["m"], "merge the shot with the next", mergeHere],
    [["e"], "leave the shot as SDR, or expand it again", switchHere],
    [["q"], "toggle settings of the clip and of this shot",
      () => byId(S.scope_of === "clip" ? "of-shot" : "of-clip").click()],
    [["v"], "variants", showVariants], [["Ctrl+z"], "undo", () => edit({ do: "undo" })],
    [["Ctrl+y", "Ctrl+Shift+Z"], "redo", () => edit({ do: "redo" })],
    [["Ctrl+Backspace"], "reset all", resetAll],
    [["Ctrl+s"], "save preset and shot list", saveAll],
    [["r"], "save and render …", showFiles],
    [["?"], "this help", () => byId("help").showModal()]]],
];
const NAMES = { " ": "Space", ArrowRight: "→", ArrowLeft: "←", ArrowUp: "↑", ArrowDown: "↓" };
const BY_KEY = new Map(KEYS.flatMap(([, rows]) =>
  rows.flatMap(([keys, , action]) => keys.map((key) => [key, action]))));

function spelled(e) {
  const isLetter = e.key.length > 1 || /[a-z]/i.test(e.key);
  // By Shift alone: Caps Lock turns letters round.
  const key = e.key.length > 1 ? e.key : e.shiftKey ? e.key.toUpperCase() : e.key.toLowerCase();
  return `${e.ctrlKey || e.metaKey ? "Ctrl+" : ""}${e.shiftKey && isLetter ? "Shift+" : ""}${key}`;
}

// In a field the browser has the keys, those of editing as well; Ctrl+S saves from there, too.
const FROM_FIELDS = ["Ctrl+s"];

async function pressed(e) {
  if (e.defaultPrevented || e.altKey || document.querySelector("dialog[open]")) return;
  // The focus leaves a dialog that was closed only when the page is drawn next.
  const { tagName, type } = e.target.closest("dialog") ? document.body : e.target;
  const isField = tagName === "INPUT" && !["checkbox", "radio", "range"].includes(type);
  const moves = tagName === "INPUT" && e.key.startsWith("Arrow");
  const name = spelled(e), isCommand = name.startsWith("Ctrl+");
  if (isField && !FROM_FIELDS.includes(name)) return;
  if ((moves || tagName === "SELECT") && !isCommand) return;
  if (e.key === " " && ["BUTTON", "SUMMARY", "INPUT"].includes(tagName)) return;
  const action = BY_KEY.get(name);
  if (!action) return;
  e.preventDefault();
  if (isCommand && !(await committed())) return;
  action(e);
}

export function openKeys() {
  byId("help-keys").append(...KEYS.map(([title, rows]) => {
    const section = document.createElement("section"), heading = document.createElement("h3");
    const list = document.createElement("dl");
    heading.textContent = title;
    for (const [keys, words] of rows) {
      const term = document.createElement("dt"), said = document.createElement("dd");
      term.append(...keys.map((key) => Object.assign(document.createElement("kbd"),
        { textContent: key.replace(/Arrow\w+| /, (name) => NAMES[name]) })));
      said.textContent = words;
      list.append(term, said);
    }
    section.append(heading, list);
    return section;
  }));
  byId("open-help").addEventListener("click", () => byId("help").showModal());
  byId("help-close").addEventListener("click", () => byId("help").close());
  byId("keep-b").addEventListener("click", keepB);
  byId("swap").addEventListener("click", () => edit({ do: "swap" }));
  byId("undo").addEventListener("click", () => edit({ do: "undo" }));
  byId("redo").addEventListener("click", () => edit({ do: "redo" }));
  document.addEventListener("keydown", pressed);
}
