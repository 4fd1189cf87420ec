"""A GIF's canvas, clear where no frame has painted yet, as browsers show it (GIF89a, 18 and 20)."""

from __future__ import annotations

# A picture of one clear pixel, kept: on it Pillow makes the whole canvas clear.
_CLEAR = (
    bytes([0x21, 0xF9, 4, 0x05, 0, 0, 0, 0])
    + bytes([0x2C, 0, 0, 0, 0, 1, 0, 1, 0, 0x80])
    + bytes(6)
    + bytes([2, 2, 0x44, 0x01, 0])
)


def on_clear_canvas(data: bytes) -> tuple[bytes, int]:
    """The file, with a clear picture before its first where that leaves canvas uncovered.

    Also how many pictures were put before (0 or 1). Pillow fills such canvas with the palette's
    first colour, unless the first frame has a transparent one.
    """
    if len(data) < 13:
        return data, 0
    width, height = (int.from_bytes(data[at : at + 2], "little") for at in (6, 8))
    begin = 13 + (3 << (data[10] & 7) + 1 if data[10] & 0x80 else 0)
    at, has_clear = begin, False
    while at + 10 <= len(data) and data[at] != 0x2C:
        if data[at] != 0x21:
            at += 1  # padding between blocks, or the trailer
            continue
        if data[at + 1] == 0xF9:
            has_clear = bool(data[at + 3] & 1)
        at += 2
        while at < len(data) and data[at]:
            at += data[at] + 1
        at += 1
    if at + 10 > len(data) or has_clear:
        return data, 0
    left, top, across, down = (
        int.from_bytes(data[at + i : at + i + 2], "little") for i in (1, 3, 5, 7)
    )
    if left == 0 and top == 0 and across >= width and down >= height:
        return data, 0
    return data[:begin] + _CLEAR + data[begin:], 1
