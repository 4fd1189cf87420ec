"""Reading an analysis back and checking every entry, as people edit these files by hand."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import fields
from difflib import get_close_matches
from fractions import Fraction
from typing import Any

from itmo_video.analysis.model import (
    FORMAT,
    FORMAT_NAME,
    READ_ME,
    Analysis,
    Bars,
    Shot,
    Statistics,
    Suggestion,
)
from itmo_video.errors import InputError, UsageError
from itmo_video.options import checked_path
from itmo_video.presets import check_own
from itmo_video.regular_file import StrPath
from itmo_video.settings import LOOK
from itmo_video.untrusted import parse_json, parse_rational, read_text
from itmo_video.words import cut

_OF_SHOT = ("first", "last", "enabled", "statistics", "rendering")


def read_analysis(path: StrPath) -> Analysis:
    """Read the file `path`; raises UsageError unless it is a complete and consistent analysis.

    >>> from itmo_video import RunOptions, analyse, convert, read_analysis
    >>> from pathlib import Path
    >>> _ = Path("shots.json").write_text(analyse("clip.mkv").to_json())
    >>> convert("clip.mkv", "out", run=RunOptions(analysis=read_analysis("shots.json"))).written
    3
    """
    try:
        text = read_text(checked_path(path, "path"))
    except InputError as error:
        raise _bad(error.what, str(path)) from error
    return parse_analysis(text, where=str(path))


def parse_analysis(text: str, *, where: str) -> Analysis:
    """Parse JSON text; raises UsageError, naming `where` and the entry, for anything invalid."""
    try:
        return _analysis(parse_json(text), where)
    except _WrongError as error:
        raise _bad(str(error), where) from error
    except ValueError as error:
        raise _bad(f"it is not JSON: {error}", where) from error


class _WrongError(Exception):
    """An error in the file's content."""


def _bad(why: str, where: str) -> UsageError:
    return UsageError(
        f"not a valid analysis: {cut(why)}",
        where=where,
        remedy="Correct it, or write it again: itmo-video analyse INPUT --output FILE.json",
    )


def _analysis(data: Any, where: str) -> Analysis:
    if not isinstance(data, dict) or FORMAT_NAME not in data:
        raise _WrongError(f"it has no {FORMAT_NAME!r}")
    number = data.pop(FORMAT_NAME)
    if isinstance(number, bool) or number not in (1, FORMAT):
        raise _WrongError(f"its format is {number}, this version reads {FORMAT}")
    data.pop(READ_ME, None)  # for people
    names = [f.name for f in fields(Analysis) if f.name != "where"]
    _check_names(data, names, names, "the file")
    first, frames = _whole(data, "first_number"), _whole(data, "frames")
    last = first + frames - 1
    entries = _list(data, "shots") if number == FORMAT else _of_format_1(_list(data, "shots"))
    shots = [_shot(entry, i) for i, entry in enumerate(entries)]
    _check_order(shots, first, last)
    return Analysis(
        source_name=_text(data, "source_name"),
        digest=_text(data, "digest"),
        frames=frames,
        first_number=first,
        cuts=_numbers(data, "cuts", first, last),
        keyframes=_numbers(data, "keyframes", first, last),
        times_s=tuple(_time(value) for value in _list(data, "times_s")),
        statistics=_statistics(data["statistics"], "statistics"),
        bars=_bars(data["bars"]),
        suggestions=tuple(_suggestion(entry) for entry in _list(data, "suggestions")),
        shots=tuple(shots),
        where=where,
    )


def _shot(entry: Any, position: int) -> Shot:
    place = f"shots[{position}]"
    if isinstance(entry, dict):
        if "first" in entry and "last" in entry:
            place = f"shot {entry['first']}-{entry['last']}"
        named = [str(name).replace("-", "_") for name in entry]
        if len(set(named)) < len(named):
            twice = Counter(named).most_common(1)[0][0]
            raise _WrongError(f"{place}: {twice} is given twice, with - and with _")
        entry = dict(zip(named, entry.values(), strict=True))
    _check_names(entry, (*_OF_SHOT, "preset", *LOOK), ["first", "last"], place)
    place = f"shot {entry['first']}-{entry['last']}"
    statistics = entry.get("statistics")
    shot = Shot(
        first=_whole(entry, "first", place),
        last=_whole(entry, "last", place),
        own={n: v for n, v in entry.items() if n not in _OF_SHOT and v is not None},
        enabled=entry.get("enabled", True),
        statistics=None if statistics is None else _statistics(statistics, place),
        rendering=None if entry.get("rendering") is None else _text(entry, "rendering"),
    )
    if not isinstance(shot.enabled, bool):
        raise _WrongError(f"{place}: enabled must be true or false, not {shot.enabled!r}")
    try:
        check_own(shot.own)
    except UsageError as error:
        raise _WrongError(f"{place}: {error.what}") from error
    return shot


def _of_format_1(shots: Sequence[Any]) -> list[Any]:
    """Shots as written before format 2, with a strength that multiplied the conversion's."""
    for shot in shots:
        if isinstance(shot, dict) and shot.get("strength", 1.0) != 1.0:
            raise _WrongError(
                f"shot {shot.get('first')}-{shot.get('last')}: strength {shot['strength']} is from "
                f"format 1, in which it multiplied the conversion's; in format {FORMAT} it equals "
                f'--strength. Change it accordingly, and set "{FORMAT_NAME}" to {FORMAT}'
            )
    return [
        {n: v for n, v in shot.items() if n != "strength"} if isinstance(shot, dict) else shot
        for shot in shots
    ]


def _check_order(shots: Sequence[Shot], first: int, last: int) -> None:
    before = first - 1
    for shot in shots:
        place = f"shot {shot.first}-{shot.last}"
        if shot.last < shot.first:
            raise _WrongError(f"{place} ends before it starts")
        if shot.first <= before:
            raise _WrongError(f"{place} overlaps the previous one, or lies before frame {first}")
        if shot.last > last:
            raise _WrongError(f"{place} goes beyond the last frame, {last}")
        before = shot.last


def _check_names(data: Any, known: Sequence[str], needed: Sequence[str], place: str) -> None:
    if not isinstance(data, dict):
        raise _WrongError(f"{place} is not a table")
    if unknown := sorted(set(data) - set(known)):
        alike = get_close_matches(str(unknown[0]), known, 1)
        hint = f"did you mean {alike[0]}?" if alike else f"known are {', '.join(known)}"
        raise _WrongError(f"{place}: unknown {', '.join(map(str, unknown))}; {hint}")
    if missing := [name for name in needed if name not in data]:
        raise _WrongError(f"{place}: {', '.join(missing)} is missing")


def _whole(data: Mapping[str, Any], name: str, place: str = "the file") -> int:
    value = data[name]
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise _WrongError(f"{place}: {name} must be a whole number, 0 or more, not {value!r}")
    return value


def _real(value: Any, place: str) -> float:
    if not isinstance(value, int | float) or isinstance(value, bool) or not abs(value) < 1e300:
        raise _WrongError(f"{place} must be a number, not {value!r}")
    return float(value)


def _text(data: Mapping[str, Any], name: str) -> str:
    if not isinstance(data[name], str):
        raise _WrongError(f"{name} must be text")
    return str(data[name])


def _list(data: Mapping[str, Any], name: str) -> list[Any]:
    value = data[name]
    if not isinstance(value, list):
        raise _WrongError(f"{name} must be a list")
    return value


def _numbers(data: Mapping[str, Any], name: str, first: int, last: int) -> tuple[int, ...]:
    values = _list(data, name)
    for value in values:
        if not isinstance(value, int) or isinstance(value, bool) or not first <= value <= last:
            raise _WrongError(f"{name}: {value!r} is not a frame from {first} to {last}")
    return tuple(values)


def _time(value: Any) -> Fraction:
    try:
        return parse_rational(str(value))
    except ValueError:
        raise _WrongError(f"times_s: {value!r} is not a time") from None


def _statistics(data: Any, place: str) -> Statistics:
    names = [f.name for f in fields(Statistics)]
    _check_names(data, names, names, f"{place}: statistics")
    return Statistics(**{name: _real(data[name], f"{place}: {name}") for name in names})


def _bars(data: Any) -> Bars:
    names = [f.name for f in fields(Bars)]
    _check_names(data, names, names, "bars")
    return Bars(**{name: _whole(data, name, "bars") for name in names})


def _suggestion(data: Any) -> Suggestion:
    names = [f.name for f in fields(Suggestion)]
    _check_names(data, names, names, "suggestions")
    if not isinstance(data["value"], int | float | str | bool):
        raise _WrongError("suggestions: a value must be a number, text, true or false")
    return Suggestion(_text(data, "setting"), data["value"], _text(data, "reason"))
