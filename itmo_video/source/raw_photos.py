"""Cameras' raw files that look like TIFF, and TIFFs whose first picture is a thumbnail."""

from __future__ import annotations

import struct

from itmo_video.errors import InputError

_SUBFILE, _PHOTOMETRIC, _DNG = 254, 262, 50706
_SENSOR = (32803, 34892)  # colour filter array, linear raw
_MOST_ENTRIES = 1000


def check_tiff(data: bytes, where: str) -> None:
    """Raise InputError where a TIFF's first directory is no finished picture."""
    tags = first_directory(data)
    is_raw = _DNG in tags or tags.get(_PHOTOMETRIC) in _SENSOR or data[8:10] == b"CR"
    if is_raw:
        raise InputError(
            "it is a camera's raw file, not a picture yet",
            where=where,
            remedy="Develop it first (darktable, RawTherapee, Lightroom) and give the result.",
        )
    if tags.get(_SUBFILE, 0) & 1:
        raise InputError(
            "its first picture is a thumbnail",
            where=where,
            remedy="Export the whole picture as TIFF, PNG or JPEG.",
        )


def first_directory(data: bytes) -> dict[int, int]:
    """First values of the entries of a TIFF's first directory (TIFF 6.0, 2; BigTIFF), by tag."""
    order = "<" if data[:2] == b"II" else ">"
    try:
        is_big = struct.unpack_from(f"{order}H", data, 2)[0] == 43
        at = struct.unpack_from(f"{order}{'Q' if is_big else 'I'}", data, 8 if is_big else 4)[0]
        count = struct.unpack_from(f"{order}{'Q' if is_big else 'H'}", data, at)[0]
        at, step, value_at = (at + 8, 20, 12) if is_big else (at + 2, 12, 8)
        found: dict[int, int] = {}
        for i in range(min(count, _MOST_ENTRIES)):
            tag, kind = struct.unpack_from(f"{order}HH", data, at + step * i)
            form = {1: "B", 3: "H", 4: "I"}.get(kind)
            if form is not None:
                found[tag] = struct.unpack_from(f"{order}{form}", data, at + step * i + value_at)[0]
        return found
    except struct.error:
        return {}
