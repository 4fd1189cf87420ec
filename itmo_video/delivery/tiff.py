"""Writing a 16-bit R'G'B' TIFF with an ICC profile: one deflated strip (TIFF 6.0; tag 34675)."""

from __future__ import annotations

import struct
import zlib

import numpy as np
import numpy.typing as npt

_SHORT, _LONG, _UNDEFINED = 3, 4, 7
_WIDTHS = {_SHORT: ("H", 2), _LONG: ("I", 4), _UNDEFINED: ("B", 1)}
_MOST_BYTES = 2**32 - 2**20  # offsets have 32 bits


def tiff_rgb16(codes: npt.NDArray[np.uint16], icc: bytes) -> bytes:
    """The file's bytes; `codes` are (H, W, 3), full range. ValueError beyond 4 GB."""
    height, width, _ = codes.shape
    # Predictor 2: differences along a row, which compress far better.
    steps = codes.astype("<u2")
    steps[:, 1:] -= codes[:, :-1]
    picture = zlib.compress(steps.tobytes(), 4)
    if len(picture) > _MOST_BYTES:
        raise ValueError("the picture is too large for TIFF")
    fields = [
        (256, _LONG, [width]), (257, _LONG, [height]), (258, _SHORT, [16, 16, 16]),
        (259, _SHORT, [8]), (262, _SHORT, [2]), (273, _LONG, [0]), (277, _SHORT, [3]),
        (278, _LONG, [height]), (279, _LONG, [len(picture)]), (284, _SHORT, [1]),
        (317, _SHORT, [2]), (34675, _UNDEFINED, list(icc)),
    ]  # fmt: skip
    more_at = 8 + 2 + 12 * len(fields) + 4
    sizes = [_WIDTHS[kind][1] * len(values) for _, kind, values in fields]
    # Values of more than four bytes follow the entries, then the picture.
    picture_at = more_at + sum(size + size % 2 for size in sizes if size > 4)
    entries, more = struct.pack("<H", len(fields)), b""
    for tag, kind, values in fields:
        numbers = [picture_at] if tag == 273 else values
        body = struct.pack(f"<{len(numbers)}{_WIDTHS[kind][0]}", *numbers)
        entries += struct.pack("<HHI", tag, kind, len(numbers))
        if len(body) <= 4:
            entries += body.ljust(4, b"\0")
        else:
            entries += struct.pack("<I", more_at + len(more))
            more += body + bytes(len(body) % 2)
    return b"II*\0" + struct.pack("<I", 8) + entries + bytes(4) + more + picture
