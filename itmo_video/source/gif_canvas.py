"""A GIF's canvas, transparent until a frame paints on it, as in browsers (GIF89a, 18 to 23)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

_TO_BACKGROUND = 2  # disposal; browsers clear to transparent, whatever the background colour
# A transparent picture of one pixel: with it first, Pillow starts with a transparent canvas.
_CLEAR = (
    bytes([0x21, 0xF9, 4, 0x05, 0, 0, 0, 0])
    + bytes([0x2C, 0, 0, 0, 0, 1, 0, 1, 0, 0x80])
    + bytes(6)
    + bytes([2, 2, 0x44, 0x01, 0])
)


@dataclass(frozen=True)
class _Area:
    left: int
    top: int
    right: int
    bottom: int
    disposal: int = 0
    has_clear: bool = False

    def hides(self, other: _Area) -> bool:
        return (
            not self.has_clear
            and (self.left <= other.left and self.top <= other.top)
            and (self.right >= other.right and self.bottom >= other.bottom)
        )


def on_clear_canvas(data: bytes) -> tuple[bytes, int]:
    """The file, with a transparent picture put first if part of the canvas shows.

    Also returns the number of pictures added (0 or 1). Pillow fills such canvas with a colour of
    the palette, unless the first frame has a transparent one.
    """
    areas = list(_areas(data))
    if not areas or areas[0].has_clear:
        return data, 0
    width, height = (int.from_bytes(data[at : at + 2], "little") for at in (6, 8))
    if areas[0].hides(_Area(0, 0, width, height)) and not _uncovers(areas):
        return data, 0
    begin = _begin(data)
    return data[:begin] + _CLEAR + data[begin:], 1


def uncovers(data: bytes) -> bool:
    """Whether a frame is removed and the next one does not cover its area."""
    return _uncovers(list(_areas(data)))


def _uncovers(areas: list[_Area]) -> bool:
    return any(
        one.disposal == _TO_BACKGROUND and not then.hides(one) for one, then in pairwise(areas)
    )


def _begin(data: bytes) -> int:
    return 13 + (3 << (data[10] & 7) + 1 if data[10] & 0x80 else 0)


def _areas(data: bytes) -> Iterator[_Area]:
    if len(data) < 13:
        return
    at, flags = _begin(data), 0
    while at + 10 <= len(data) and data[at] != 0x3B:
        if data[at] == 0x2C:
            left, top, across, down = (
                int.from_bytes(data[at + i : at + i + 2], "little") for i in (1, 3, 5, 7)
            )
            disposal, has_clear = flags >> 2 & 7, bool(flags & 1)
            yield _Area(left, top, left + across, top + down, disposal, has_clear)
            flags, own = 0, data[at + 9]
            at += 11 + (3 << (own & 7) + 1 if own & 0x80 else 0)
        elif data[at] == 0x21:
            flags = data[at + 3] if data[at + 1] == 0xF9 else flags
            at += 2
        else:
            at += 1  # padding between blocks
            continue
        while at < len(data) and data[at]:
            at += data[at] + 1
        at += 1
