"""Other programs' EXR files: data and display windows, and choosing a part."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from itmo_video.errors import InputError
from itmo_video.output.exr_chunks import ExrDamageError, parse_header

_MOST_PARTS = 256
_MULTI_PART = 0x1000  # of the version field


def in_display_window(pixels: npt.NDArray[Any], attributes: Mapping[str, Any]) -> npt.NDArray[Any]:
    """A channel as displayed: its data window placed in the display window, 0 around it."""
    (left, top), (right, bottom) = (np.asarray(c, np.int64) for c in attributes["displayWindow"])
    (x, y), _ = (np.asarray(corner, np.int64) for corner in attributes["dataWindow"])
    height, width = pixels.shape
    if (x, y) == (left, top) and (width, height) == (right - left + 1, bottom - top + 1):
        return pixels
    out = np.zeros((bottom - top + 1, right - left + 1), pixels.dtype)
    to_x, to_y = max(x - left, 0), max(y - top, 0)
    from_x, from_y = max(left - x, 0), max(top - y, 0)
    inside = pixels[from_y : from_y + max(out.shape[0] - to_y, 0), from_x:]
    inside = inside[:, : max(out.shape[1] - to_x, 0)]
    out[to_y : to_y + inside.shape[0], to_x : to_x + inside.shape[1]] = inside
    return out


def is_multi_part(data: bytes) -> bool:
    """Whether a file may have several parts."""
    return len(data) >= 8 and bool(struct.unpack_from("<I", data, 4)[0] & _MULTI_PART)


def headers(data: bytes) -> Iterator[dict[str, tuple[str, bytes]]]:
    """Each part's attributes, as (type, value) by name; raises ExrDamageError."""
    attributes, end = parse_header(data)
    yield attributes
    if not is_multi_part(data):
        return
    for _ in range(_MOST_PARTS):
        if data[end : end + 1] in (b"\0", b""):
            return
        attributes, end = parse_header(data, end)
        yield attributes
    raise ExrDamageError(f"it has more than {_MOST_PARTS} parts")


def part_index(parts: Sequence[Any], wanted: str | None, where: str) -> int:
    """The index of a part: by name, by number, or the first with R, G and B."""
    if not parts:
        raise ExrDamageError("it has no readable part")
    names = [str(part.header.get("name", number)) for number, part in enumerate(parts)]
    if wanted is None:
        pictures = [n for n, part in enumerate(parts) if {"R", "G", "B"} <= set(part.channels)]
        return pictures[0] if pictures else 0
    if wanted in names:
        return names.index(wanted)
    if wanted.isdecimal() and int(wanted) < len(parts):
        return int(wanted)
    raise InputError(
        f"there is no part {wanted}", where=where, remedy=f"Parts: {', '.join(names)}."
    )
