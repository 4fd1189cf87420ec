"""A file's metadata before its frames are read: container, packets, tags, content.

Nothing but local files in known containers is opened, and no picture larger than the limit.
"""

from __future__ import annotations

import os
from pathlib import Path

from itmo_video.errors import InputError
from itmo_video.regular_file import open_regular

PICTURE_BYTES = 1 << 30  # a file of one picture, at most: it is read whole


# ---- files ----


def check_file(path: Path) -> None:
    """Raise InputError unless there is a readable, regular file with something in it."""
    if path.is_dir():
        raise InputError(
            "is a folder, not a clip",
            where=str(path),
            remedy="For an image sequence give its pattern, such as folder/img.%04d.png.",
        )
    if any(mark in path.name for mark in "*?[") and not os.path.lexists(path):
        raise InputError(
            "no such file, and no shell filled in its pattern",
            where=str(path),
            remedy="Leave the quotes out, or name a sequence by its digits: img.%04d.png.",
        )
    with open_regular(path) as file:
        if os.fstat(file.fileno()).st_size == 0:
            raise InputError("the file is empty", where=str(path))


# ---- containers ----


def check_pixels(width: int, height: int, max_pixels: int, where: str) -> None:
    """Raise InputError for pictures that are larger than the limit."""
    if width * height > max_pixels:
        raise InputError(
            f"{width}x{height} is more than {max_pixels} pixels a frame",
            where=where,
            remedy="Raise --max-pixels if that is meant.",
        )
