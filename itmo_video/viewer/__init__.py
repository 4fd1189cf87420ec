"""The viewer that the studio and reports share: ES modules, by name."""

from __future__ import annotations

from importlib import resources


def modules() -> dict[str, str]:
    """The text of each module by the name that it is imported by, `viewer/light.js` and so on."""
    folder = resources.files("itmo_video.viewer")
    names = sorted(entry.name for entry in folder.iterdir() if entry.name.endswith(".js"))
    return {f"viewer/{name}": folder.joinpath(name).read_text("utf-8") for name in names}
