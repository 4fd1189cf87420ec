"""A GIF's canvas, transparent until a frame paints on it, as in browsers (GIF89a, 18 to 23)."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from itmo_video.source.gif_areas import Area, begin_of_blocks, read_areas

_TO_BACKGROUND = 2  # disposal; browsers clear to transparent, whatever the background colour
# A transparent picture of one pixel: with it first, Pillow starts with a transparent canvas.
_CLEAR = (
    bytes([0x21, 0xF9, 4, 0x05, 0, 0, 0, 0])
    + bytes([0x2C, 0, 0, 0, 0, 1, 0, 1, 0, 0x80])
    + bytes(6)
    + bytes([2, 2, 0x44, 0x01, 0])
)


def on_clear_canvas(data: bytes) -> tuple[bytes, int]:
    """The file, with a transparent picture put first if part of the canvas shows.

    Also returns the number of pictures added (0 or 1). Pillow fills such canvas with a colour of
    the palette, unless the first frame has a transparent one.
    """
    areas, _ = read_areas(data)
    if not areas or areas[0].has_clear:
        return data, 0
    width, height = (int.from_bytes(data[at : at + 2], "little") for at in (6, 8))
    if areas[0].hides(Area(0, 0, width, height)) and not _uncovers(areas):
        return data, 0
    begin = begin_of_blocks(data)
    return data[:begin] + _CLEAR + data[begin:], 1


def needs_alpha(areas: Sequence[Area]) -> bool:
    """Whether a frame is removed that was transparent itself, or that the next does not cover."""
    return _uncovers(areas) or any(
        one.disposal == _TO_BACKGROUND and one.has_clear and one.is_whole for one in areas
    )


def _uncovers(areas: Sequence[Area]) -> bool:
    return any(
        one.disposal == _TO_BACKGROUND and not then.hides(one) for one, then in pairwise(areas)
    )
