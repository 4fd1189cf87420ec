"""Checks on a file before its frames are read.

Only local files in known containers are opened, and no picture larger than the limit.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from itmo_video.errors import InputError
from itmo_video.options import option
from itmo_video.regular_file import open_regular

MAX_PIXELS = 2**27  # of a frame, unless the user raises it
PICTURE_BYTES = 1 << 30  # the largest file of a single picture, as it is read at once


# ---- files ----


def check_file(path: Path) -> None:
    """Raise InputError unless `path` is a readable, regular, non-empty file."""
    if path.is_dir():
        raise InputError(
            "is a folder, not a clip",
            where=str(path),
            remedy=f"Give its films, as {path}/*.mp4, or an image sequence by its pattern, as"
            f" {path}/img.%04d.png.",
        )
    if any(mark in path.name for mark in "*?[") and not os.path.lexists(path):
        raise InputError(
            "no such file: the pattern was not expanded by a shell",
            where=str(path),
            remedy="Remove the quotes, or give a sequence by its digits: img.%04d.png.",
        )
    with open_regular(path) as file:
        if os.fstat(file.fileno()).st_size == 0:
            raise InputError("the file is empty", where=str(path))


# ---- pixels ----


def pixel_limit() -> Any:
    """The option `max_pixels` of each command that reads a source."""
    return option(MAX_PIXELS, int, "refuse frames with more than N pixels", lower=1, metavar="N")


def check_pixels(width: int, height: int, max_pixels: int, where: str) -> None:
    """Raise InputError if pictures are larger than the limit."""
    if width * height > max_pixels:
        raise InputError(
            f"{width}x{height} exceeds the limit of {max_pixels} pixels per frame",
            where=where,
            remedy="Raise --max-pixels if this is intended.",
        )
