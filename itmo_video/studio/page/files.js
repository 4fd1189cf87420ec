// Saving, the command to copy, and the render, which continues when the page is closed.

import { post } from "./api.js";
import { committed } from "./edits.js";
import { failed, on, refresh, S, take, told } from "./store.js";

const byId = (id) => document.getElementById(id);

// In the dialog, too: it covers the line at the bottom.
function says(text, isError = false) {
  told(text, isError);
  byId("save-says").textContent = text;
  byId("save-says").classList.toggle("error", isError);
}

async function save(kind, replace = false) {
  const name = byId(`${kind}-name`).value.trim();
  if (!(await committed())) return false;
  says("");
  try {
    const { path, state, exists } = await post("api/save", { kind, name, replace });
    if (exists) return window.confirm(exists) ? save(kind, true) : false;
    take(state);
    says(`Saved: ${path}`);
    return true;
  } catch (error) {
    failed(error);
    says(error.message, true);
    return false;
  }
}

export async function saveAll() {
  if (await save("preset") && S.state.is_analysed) await save("shots");
}

// Why the last render was not even begun: said in the dialog, which covers the line at the bottom.
let refusal = "";
async function render(kind) {
  if (!(await committed())) return;
  refusal = "";
  const name = byId("render-name").value.trim(), again = byId("render-again").checked;
  try {
    take(await post("api/render", { kind, name, again }));
    byId("render-again").checked = false;  // to be ticked again for the next one
    follow();
  } catch (error) {
    refusal = error.message;
    failed(error);
  }
  update();
}

const minutes = (s) => (s >= 90 ? `${Math.round(s / 60)} min` : `${Math.ceil(s)} s`);

function words({ state, done, of, left_s, output, seconds, message, is_ending: isEnding }) {
  if (isEnding && state === "running") return "Cancelling …";
  if (state === "running")
    return `${done} of ${of || "…"} frames${left_s === null ? "" : `, ${minutes(left_s)} left`}`;
  return { none: "", done: `Done in ${minutes(seconds)}: ${output}`, failed: message,
    cancelled: `Cancelled; finished frames are intact. Render again to resume: ${output}` }[state];
}

function update() {
  const { render: r, command } = S.state, isRunning = r.state === "running";
  byId("command").textContent = command;
  byId("unsaved-preset").hidden = !S.state.preset_needs_saving;
  byId("unsaved").hidden = !S.state.shots_need_saving;
  byId("render-progress").hidden = !isRunning;
  byId("render-progress").value = r.of ? r.done / r.of : 0;
  byId("render-says").textContent = refusal || words(r);
  byId("render-says").classList.toggle("error", Boolean(refusal) || r.state === "failed");
  byId("render-badge").textContent = isRunning && r.of ? ` ${Math.floor(100 * r.done / r.of)} %` : "";
  document.title = `${isRunning && r.of ? `${Math.floor(100 * r.done / r.of)} % ` : ""}${S.about.name} – studio`;
  for (const id of ["render-convert", "render-preview"]) byId(id).disabled = isRunning;
  byId("render-cancel").disabled = !isRunning || r.is_ending;
}

// Polls the progress of the render and of finding cuts, while either is running.
let following = 0;
export function follow() {
  clearTimeout(following);
  const { render: r, is_analysed: done, analysis_error: error } = S.state;
  if (r.state !== "running" && (done || error)) return;
  following = setTimeout(async () => {
    try { await refresh(); } catch (problem) { failed(problem); }
    follow();
  }, 400);
}

// A name's button, also by Enter; what was said of the name before it was changed is past.
function onName(kind, act, button) {
  const field = byId(`${kind}-name`);
  button.addEventListener("click", act);
  field.addEventListener("keydown", (e) => { if (e.key === "Enter") act(); });
  field.addEventListener("input", () => says(""));
}

export function showFiles() {
  says("");
  refusal = "";
  update();
  byId("files").showModal();
}

export function openFiles() {
  const { suggested } = S.about;
  byId("preset-name").value = suggested;
  byId("shots-name").value = suggested;
  byId("render-name").value = `${suggested}_hdr`;
  byId("folder").textContent = S.about.folder;
  for (const kind of ["preset", "shots"])
    onName(kind, () => save(kind), byId(`save-${kind}`));
  byId("copy").addEventListener("click", async () => {
    try {
      await navigator.clipboard.writeText(S.state.command);
      told("Command copied.");
    } catch {
      getSelection().selectAllChildren(byId("command"));
      told("The browser does not allow copying. The command is selected: press Ctrl+C.");
    }
  });
  byId("render-convert").addEventListener("click", () => render("convert"));
  byId("render-preview").addEventListener("click", () => render("preview"));
  byId("render-cancel").addEventListener("click", async () => {
    try { take(await post("api/render", { do: "cancel" })); } catch (error) { failed(error); }
  });
  byId("open-files").addEventListener("click", showFiles);
  byId("files-close").addEventListener("click", () => byId("files").close());
  on("state", update);
  update();
  follow();
}
