"""The viewer shared by the studio and reports: ES modules, by name."""

from __future__ import annotations

from importlib import resources


def modules() -> dict[str, str]:
    """The text of each module by its import name, such as `viewer/light.js`."""
    folder = resources.files("itmo_video.viewer")
    names = sorted(entry.name for entry in folder.iterdir() if entry.name.endswith(".js"))
    return {f"viewer/{name}": folder.joinpath(name).read_text("utf-8") for name in names}
