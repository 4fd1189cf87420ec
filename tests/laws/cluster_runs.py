"""A clip, its whole conversion, and how runs on a cluster are compared with it."""

from __future__ import annotations

from pathlib import Path

from itmo_video import make_settings

SETTINGS = make_settings("default", lights=64, radius=64, compression="zips")


def files(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}
