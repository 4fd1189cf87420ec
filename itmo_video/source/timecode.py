"""SMPTE 12M timecodes, counted in frames."""

from __future__ import annotations

import re
from fractions import Fraction

# Editors separate with ";" or "." before FF, or everywhere, for drop frame.
_CODE = re.compile(r"(\d\d)([:;.])(\d\d)[:;.](\d\d)([:;.])(\d\d)")


def fits(rate: Fraction) -> bool:
    """Whether EXR's timeCode supports a frame rate: SMPTE 12M's fields end at 30 fps."""
    return round(rate) <= 30


def is_drop_frame(code: str) -> bool:
    """Whether a timecode is written as drop frame: "HH:MM:SS;FF"."""
    match = _CODE.fullmatch(code)
    return match is not None and match[5] != ":"


def count_of(code: str, base: int, is_drop: bool) -> int | None:
    """The frames from 00:00:00:00 to a timecode, or None if it is not one.

    `base` are the frame numbers of a second (30 at 29.97 fps). Drop frame skips the first numbers
    of each minute except every tenth (SMPTE 12M-1, 8.1.2); bases that are no multiple of 30 have
    none.
    """
    match = _CODE.fullmatch(code)
    if match is None:
        return None
    hours, minutes, seconds, frame = (int(match[i]) for i in (1, 3, 4, 6))
    minutes += hours * 60
    count = (minutes * 60 + seconds) * base + frame
    return count - (_dropped(base) * (minutes - minutes // 10) if is_drop else 0)


def code_of(count: int, base: int, is_drop: bool, separator: str = ":") -> str:
    """The timecode of a count of frames; `separator` comes before FF. Wraps after 24 hours."""
    dropped = _dropped(base) if is_drop else 0
    per_ten = 600 * base - 9 * dropped
    tens, rest = divmod(count % (144 * per_ten), per_ten)
    # In each ten minutes the first minute is complete; the other nine lack the dropped numbers.
    lost = 0 if rest < 60 * base else 1 + (rest - 60 * base) // (60 * base - dropped)
    seconds, frame = divmod(tens * 600 * base + rest + dropped * lost, base)
    hours, minutes = seconds // 3600, seconds // 60 % 60
    return f"{hours:02d}:{minutes:02d}:{seconds % 60:02d}{separator}{frame:02d}"


def advance(start: str, frames: int, rate: Fraction) -> str | None:
    """The timecode `frames` frames after `start`, or None if that is not a timecode.

    "HH:MM:SS:FF", or with ";" before FF for drop frame. Wraps after 24 hours.
    """
    base, is_drop = max(1, round(rate)), is_drop_frame(start)
    count = count_of(start, base, is_drop)
    return None if count is None else code_of(count + frames, base, is_drop, start[-3])


def _dropped(base: int) -> int:
    return base // 15 if base % 30 == 0 else 0
