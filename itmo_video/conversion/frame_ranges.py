"""Frame ranges in fileseq's syntax: `1-100,200-300x2`."""

from __future__ import annotations

import re
from collections.abc import Iterable

from itmo_video.errors import UsageError
from itmo_video.words import frames_are

_PART = re.compile(r"(-?\d+)(?:-(-?\d+)(?:([xy:])(\d+))?)?", re.ASCII)
_MOST_FRAMES = 10_000_000


def parse_ranges(text: str) -> list[int]:
    """The frame numbers of a range, sorted and unique; raises UsageError for anything else.

    `a-b` is inclusive; `xN` takes every Nth from a, `yN` all but those, `:N` all (staggered).
    """
    numbers: set[int] = set()
    for part in text.replace(" ", "").split(","):
        match = _PART.fullmatch(part)
        if match is None:
            raise UsageError(
                f"frames: {part!r} is not a frame range", remedy="Examples: 7, 1-100, 200-300x2"
            )
        first = int(match[1])
        last = int(match[2]) if match[2] is not None else first
        step = int(match[4] or 1)
        if step == 0 or abs(last - first) > _MOST_FRAMES:
            raise UsageError(f"frames: {part!r} is too long or has a step of 0")
        every = range(first, last + (1 if last >= first else -1), 1 if last >= first else -1)
        stepped = set(every[::step])
        kind = match[3]
        numbers |= (
            stepped if kind in (None, "x") else set(every) - (stepped if kind == "y" else set())
        )
    return sorted(numbers)


def format_ranges(numbers: Iterable[int]) -> str:
    """Sorted numbers as short text: `1-3,7,9-12`."""
    parts: list[str] = []
    run: list[int] = []
    for number in [*sorted(numbers), None]:
        if run and (number is None or number != run[-1] + 1):
            parts.append(str(run[0]) if len(run) == 1 else f"{run[0]}-{run[-1]}")
            run = []
        if number is not None:
            run.append(number)
    return ",".join(parts)


def damage_in_words(numbers: Iterable[int]) -> list[str]:
    """One sentence about the frames whose source was damaged, or none."""
    ranges = format_ranges(numbers)
    return [f"{frames_are(ranges)} damaged in the source"] if ranges else []
