// The page: fetches facts and state, then opens its parts.

import { get } from "./api.js";
import { openFiles } from "./files.js";
import { openKeys } from "./keys.js";
import { openSettings } from "./settings.js";
import { openStage } from "./stage.js";
import { failed, on, refresh, S } from "./store.js";
import { openTimeline } from "./timeline.js";
import { openTransport } from "./transport.js";
import { openVariants } from "./variants.js";
import { openViews } from "./views.js";

async function open() {
  S.about = await get("api/about");
  await refresh();
  const { name, size, rate, frames, facts, notices } = S.about;
  document.getElementById("clip-name").textContent = name;
  document.getElementById("clip-facts").textContent =
    `${size.join("×")} · ${rate.toFixed(3).replace(/\.?0+$/, "")} fps · ${frames} frames · ${facts.transfer.value}`;
  document.getElementById("notices").hidden = !notices.length;
  document.querySelector("#notices ul").replaceChildren(...notices.map((text) =>
    Object.assign(document.createElement("li"), { textContent: text })));
  for (const part of [openStage, openTimeline, openTransport, openViews, openSettings, openVariants,
    openFiles, openKeys]) part();
  on("state", () => {
    const has = Boolean(S.state.other);
    document.getElementById("swap").disabled = !has;
    for (const input of document.getElementsByName("compare"))
      if (["b", "ab"].includes(input.value)) input.disabled = !has;
  });
  await refresh();
  // A page in another browser may have changed something meanwhile.
  window.addEventListener("focus", () => refresh().catch(failed));
  document.body.dataset.ready = "yes";
}

open().catch(failed);
