"""Combining pictures that a shell listed one by one into image sequences."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from itmo_video.errors import InputError
from itmo_video.source.files import check_file
from itmo_video.source.still_reading import kind_of
from itmo_video.source.stills import NUMBER_PATTERN, sequence

_LAST_NUMBER = re.compile(r"(.*?)([0-9]+)([^0-9]*)", re.DOTALL)


@dataclass(frozen=True)
class Listed:
    """An input as given, or a sequence's pattern; `numbers` if only some frames were listed."""

    source: str
    numbers: tuple[int, ...] | None = None


@dataclass(frozen=True)
class _Numbered:
    """A picture's name in three parts: before its last number, the number, and after it."""

    before: str
    digits: str
    after: str


def together(inputs: Sequence[str]) -> tuple[list[Listed], list[str]]:
    """Inputs with consecutively numbered pictures combined into sequences, and notices.

    Other inputs stay unchanged, in order.
    """
    groups: dict[tuple[str, str], dict[str, str]] = {}  # digits to path, by the rest of the name
    for position, path in enumerate(inputs):
        name = _numbered(path)
        if name is None or name.digits in groups.get((name.before, name.after), {}):
            groups[path, str(position)] = {"": path}  # a single input, or a picture given twice
        else:
            groups.setdefault((name.before, name.after), {})[name.digits] = path
    found: list[Listed] = []
    told: list[str] = []
    for (before, after), by_digits in groups.items():
        paths = list(by_digits.values())
        pattern = _pattern(before, after, list(by_digits)) if len(paths) > 1 else None
        if pattern is None:
            found += [Listed(path) for path in paths]
            continue
        numbers = sorted(map(int, by_digits))
        if numbers[-1] - numbers[0] + 1 > len(numbers):
            found += [Listed(path) for path in paths]
            told.append(
                f"the numbers of {paths[0]} and {len(paths) - 1} more have gaps, so each is read "
                f"as a single picture; to read a sequence, give {pattern}"
            )
            continue
        there = sequence(_absolute(pattern))
        found.append(Listed(pattern, None if len(there) == len(numbers) else tuple(numbers)))
        told.append(f"{len(paths)} pictures are read as one sequence, {pattern}")
    return found, told


def _numbered(path: str) -> _Numbered | None:
    """The parts of a still picture's name; None for anything else."""
    folder, name = os.path.split(path)
    stem, suffix = os.path.splitext(name)
    match = _LAST_NUMBER.fullmatch(stem)
    if match is None or NUMBER_PATTERN.search(match[1]):
        return None
    try:
        check_file(_absolute(path))
        if kind_of(_absolute(path)) is None:
            return None
    except InputError:
        return None  # reported when it is opened
    return _Numbered(os.path.join(folder, match[1]), match[2], match[3] + suffix)


def _pattern(before: str, after: str, digits: Sequence[str]) -> str | None:
    """The names as one pattern; None if they differ in zero padding."""
    least = min(map(len, digits))
    if any(len(text) > least and text[0] == "0" for text in digits):
        return None
    return f"{before}%0{least}d{after}"


def _absolute(path: str) -> Path:
    return Path(os.path.abspath(path))
