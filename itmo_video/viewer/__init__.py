"""The viewer shared by the studio and reports: ES modules, by name."""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib import resources
from typing import Any


def modules(aces: Mapping[str, Any] | None = None) -> dict[str, str]:
    """The text of each module by its import name, such as `viewer/light.js`.

    `aces` is the table of ACES's SDR view (delivery.aces.aces_sdr_table), which `viewer/aces.js`
    exports as ACES; without it the viewer has no such view.
    """
    folder = resources.files("itmo_video.viewer")
    names = sorted(entry.name for entry in folder.iterdir() if entry.name.endswith(".js"))
    texts = {f"viewer/{name}": folder.joinpath(name).read_text("utf-8") for name in names}
    return texts | {"viewer/aces.js": f"export const ACES = {json.dumps(aces)};\n"}
