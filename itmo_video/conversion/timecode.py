"""SMPTE 12M timecodes, counted in frames."""

from __future__ import annotations

import re
from fractions import Fraction


def fits(rate: Fraction) -> bool:
    """Whether EXR's timeCode supports a frame rate: SMPTE 12M's fields end at 30 fps."""
    return round(rate) <= 30


def advance(start: str, frames: int, rate: Fraction) -> str | None:
    """The timecode `frames` frames after `start`, or None if that is not a timecode.

    "HH:MM:SS:FF", or with ";" before FF for drop frame, which skips the first numbers of each
    minute except every tenth (SMPTE 12M-1, 8.1.2). Wraps after 24 hours.
    """
    match = re.fullmatch(r"(\d\d):(\d\d):(\d\d)([:;.])(\d\d)", start)
    if match is None:
        return None
    hours, minutes, seconds, frame = (int(match[i]) for i in (1, 2, 3, 5))
    base = max(1, round(rate))
    dropped = base // 15 if match[4] != ":" and base % 30 == 0 else 0
    total_minutes = hours * 60 + minutes
    count = (total_minutes * 60 + seconds) * base + frame
    count -= dropped * (total_minutes - total_minutes // 10)
    per_ten = 600 * base - 9 * dropped
    count = (count + frames) % (144 * per_ten)
    tens, rest = divmod(count, per_ten)
    # In each ten minutes the first minute is complete; the other nine lack the dropped numbers.
    lost = 0 if rest < 60 * base else 1 + (rest - 60 * base) // (60 * base - dropped)
    number = tens * 600 * base + rest + dropped * lost
    frame = number % base
    seconds = number // base
    return f"{seconds // 3600:02d}:{seconds // 60 % 60:02d}:{seconds % 60:02d}{match[4]}{frame:02d}"
