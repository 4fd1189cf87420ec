"""Checks of an EXR's header before memory is allocated for it."""

from __future__ import annotations

import struct

from itmo_video.output.exr_chunks import ExrDamageError, bytes_a_pixel
from itmo_video.output.exr_windows import headers

MOST_PIXEL_BYTES = 5 << 28  # 2**27 pixels of RGBA in half floats, and a quarter more
_MOST_TILE_BYTES = 1 << 28
_BYTES_OF = {
    "box2i": 16, "box2f": 16, "chromaticities": 32, "compression": 1, "double": 8, "envmap": 1,
    "float": 4, "int": 4, "keycode": 28, "lineOrder": 1, "m33f": 36, "m44f": 64, "rational": 8,
    "tiledesc": 9, "timecode": 8, "v2f": 8, "v2i": 8, "v3f": 12, "v3i": 12,
}  # fmt: skip
_REQUIRED = {  # by the format; OpenEXR's reader crashes if they are wrong
    "channels": "chlist", "compression": "compression", "dataWindow": "box2i",
    "displayWindow": "box2i", "lineOrder": "lineOrder", "pixelAspectRatio": "float",
    "screenWindowCenter": "v2f", "screenWindowWidth": "float",
}  # fmt: skip
_DEEP = 0x800  # of the version field


def check_claims(data: bytes) -> None:
    """Raise ExrDamageError for an implausible header, or one whose pixels take too much memory.

    All parts of a multi-part file are checked.
    """
    if data[4:8] and int.from_bytes(data[4:8], "little") & _DEEP:
        raise ExrDamageError("deep images, with several samples per pixel, are not supported")
    for attributes in headers(data):
        _check_part(attributes)


def _check_part(attributes: dict[str, tuple[str, bytes]]) -> None:
    for name, kind in _REQUIRED.items():
        if attributes.get(name, ("", b""))[0] != kind:
            raise ExrDamageError(f"the header is incomplete: {name} is missing")
    for name, (kind, value) in attributes.items():
        if len(value) != _BYTES_OF.get(kind, len(value)):
            raise ExrDamageError(
                f"attribute {name[:40]!r} has {len(value)} bytes, invalid for {kind}"
            )
    width, height = _window(attributes["dataWindow"][1])
    shown = _window(attributes["displayWindow"][1])
    pixel_bytes = bytes_a_pixel(attributes)
    if shown[0] * shown[1] * pixel_bytes > MOST_PIXEL_BYTES:
        raise ExrDamageError(f"the display window is implausible: {shown[0]}x{shown[1]} pixels")
    if (tiles := attributes.get("tiles", ("", b""))[1]) and (
        len(tiles) != 9
        or not 0 < pixel_bytes * int.from_bytes(tiles[:4], "little")
        * int.from_bytes(tiles[4:8], "little") <= _MOST_TILE_BYTES
    ):  # fmt: skip
        raise ExrDamageError("the tile size is implausible")
    if (needed := width * height * pixel_bytes) > MOST_PIXEL_BYTES:
        raise ExrDamageError(
            f"{width}x{height} pixels would take {needed / 2**30:.1f} GB"
            f" (limit {MOST_PIXEL_BYTES / 2**30:g} GB)"
        )
    for name, (kind, value) in attributes.items():
        if kind == "rational" and value[4:] == b"\0\0\0\0":
            raise ExrDamageError(f"attribute {name} is not a number")


def _window(value: bytes) -> tuple[int, int]:
    if len(value) != 16:
        raise ExrDamageError("the header is incomplete")
    left, top, right, bottom = struct.unpack("<4i", value)
    if right < left or bottom < top:
        raise ExrDamageError("the picture has no pixels")
    return right - left + 1, bottom - top + 1
