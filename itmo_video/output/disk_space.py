"""The disk space that a conversion needs, estimated before it starts, and the free space."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

from itmo_video.compressions import COMPRESSIONS
from itmo_video.output.atomic import output_error
from itmo_video.regular_file import StrPath
from itmo_video.settings import Settings

_HEADER_BYTES = 4096


def estimated_frame_bytes(width: int, height: int, has_alpha: bool, settings: Settings) -> int:
    """A rough upper estimate of an EXR file's bytes, by its size in pixels."""
    channels = 3 + has_alpha + len(settings.layers)
    share = COMPRESSIONS[settings.compression].share_left or 1.0
    return round(width * height * channels * 2 * share) + _HEADER_BYTES


def free_bytes(path: StrPath) -> int:
    """The free space in bytes at `path`, which need not exist yet."""
    folder = Path(path).absolute()
    while not os.path.exists(folder) and folder != folder.parent:
        folder = folder.parent
    try:
        return shutil.disk_usage(folder).free
    except OSError as error:
        raise output_error(error, folder) from error


def shortage(needed_bytes: int, left_bytes: int, where: str) -> str | None:
    """A warning if `needed_bytes` do not fit into `left_bytes`, otherwise None."""
    if needed_bytes <= left_bytes:
        return None
    return (
        f"about {in_words(needed_bytes)} needed, {in_words(left_bytes)} free at {where}; if the "
        "disk fills up, free some space and run the same command to resume"
    )


def in_words(count: int) -> str:
    """Bytes as `12.3 GB`, `45 MB`, `1.2 MB` or `3 kB`."""
    if count >= 1e9:
        return f"{count / 1e9:.1f} GB"
    if count >= 1e7:
        return f"{count / 1e6:.0f} MB"
    return f"{count / 1e6:.1f} MB" if count >= 1e6 else f"{count / 1e3:.0f} kB"
