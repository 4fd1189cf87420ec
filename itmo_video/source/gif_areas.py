"""The pictures of a GIF, found by walking its blocks (GIF89a, 12 to 27), without decoding."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

_IMAGE, _EXTENSION, _TRAILER, _CONTROL = 0x2C, 0x21, 0x3B, 0xF9


@dataclass(frozen=True)
class Area:
    """Where a picture paints, in pixels of the canvas, for how long, and how it is removed.

    `has_clear`: it has a transparent colour; `is_whole`: its data do not end early.
    """

    left: int
    top: int
    right: int
    bottom: int
    disposal: int = 0
    has_clear: bool = False
    delay_s: Fraction = Fraction(0)
    is_whole: bool = True

    def hides(self, other: Area) -> bool:
        """Whether nothing of the other area shows below this one."""
        return (
            not self.has_clear
            and (self.left <= other.left and self.top <= other.top)
            and (self.right >= other.right and self.bottom >= other.bottom)
        )


def begin_of_blocks(data: bytes) -> int:
    """Where the first block begins, after the header and the colours of the whole file."""
    return 13 + (3 << (data[10] & 7) + 1 if data[10] & 0x80 else 0)


def read_areas(data: bytes) -> tuple[list[Area], bool]:
    """The pictures in order, of which the last may be truncated; whether the file has its end."""
    areas, control = list[Area](), b""
    at = begin_of_blocks(data) if len(data) >= 13 else len(data)
    while at < len(data) and data[at] != _TRAILER:
        if data[at] == _IMAGE and at + 10 <= len(data):
            own = data[at + 9]
            blocks = at + 11 + (3 << (own & 7) + 1 if own & 0x80 else 0)
            end = _end_of_sub_blocks(data, blocks)
            areas.append(_area(data[at + 1 : at + 9], control, end <= len(data)))
            at, control = end, b""
        elif data[at] == _EXTENSION and at + 2 < len(data):
            if data[at + 1] == _CONTROL:
                control = data[at + 3 : at + 3 + data[at + 2]]
            at = _end_of_sub_blocks(data, at + 2)
        elif data[at] in (_IMAGE, _EXTENSION):
            break
        else:
            at += 1  # padding between blocks, which some writers leave
    return areas, at < len(data) and data[at] == _TRAILER


def _area(place: bytes, control: bytes, is_whole: bool) -> Area:
    left, top, across, down = (int.from_bytes(place[i : i + 2], "little") for i in (0, 2, 4, 6))
    flags = control[0] if control else 0
    delay = int.from_bytes(control[1:3], "little") if len(control) >= 4 else 0
    return Area(
        left, top, left + across, top + down,
        disposal=flags >> 2 & 7, has_clear=bool(flags & 1),
        delay_s=Fraction(delay, 100), is_whole=is_whole,
    )  # fmt: skip


def _end_of_sub_blocks(data: bytes, at: int) -> int:
    """Where the block after these begins: beyond the data if they are truncated."""
    while at < len(data) and data[at]:
        at += data[at] + 1
    return at + 1
