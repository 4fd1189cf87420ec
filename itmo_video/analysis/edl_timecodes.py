"""Timecodes in CMX3600 edit lists, as far as OpenTimelineIO's adapter has no notion of them.

It counts drop-frame codes as non-drop ones, and always writes record times from 00:00:00:00 on.
"""

from __future__ import annotations

import re

from itmo_video.source import timecode

_EVENT = re.compile(r"\s*(\d+|M2)\s")
_CODE = re.compile(r"(?<!\S)\d\d[:;.]\d\d[:;.]\d\d[:;.]\d\d(?!\S)")
_MODE = re.compile(r"\s*FCM:?\s*(NON)?[- ]*DROP", re.IGNORECASE)


def without_drop_frame(edl: str, base: int) -> str:
    """The list with each drop-frame timecode replaced by the non-drop one of the same frame.

    Drop-frame are codes written with ";", and all after the line "FCM: DROP FRAME". `base` are the
    frame numbers of a second; at 24 or 25 nothing changes.
    """
    if base % 30:
        return edl
    is_drop, lines = False, []
    for line in edl.splitlines():
        mode = _MODE.match(line)
        if mode is not None:
            is_drop, line = mode[1] is None, "FCM: NON-DROP FRAME"
        lines.append(
            _recoded(
                line,
                [
                    timecode.code_of(
                        _count(code, base, is_drop or timecode.is_drop_frame(code)), base, False
                    )
                    for code in _codes(line)
                ],
            )
        )
    return "".join(lines)


def finished(edl: str, base: int, is_drop: bool) -> str:
    """A list by the adapter, with record times from 01:00:00:00 on, in drop frame if asked for."""
    hour, separator = _count("01:00:00:00", base, is_drop), ";" if is_drop else ":"
    lines = []
    for line in edl.splitlines():
        counts = [_count(code, base, False) for code in _codes(line)]
        counts[2:] = [count + hour for count in counts[2:]]  # the record's, after the source's
        lines.append(
            _recoded(line, [timecode.code_of(n, base, is_drop, separator) for n in counts])
        )
        if line.startswith("TITLE:"):
            lines.append(f"FCM: {'' if is_drop else 'NON-'}DROP FRAME\n")
    return "".join(lines)


def _codes(line: str) -> list[str]:
    return _CODE.findall(line) if _EVENT.match(line) else []


def _count(code: str, base: int, is_drop: bool) -> int:
    count = timecode.count_of(code, base, is_drop)
    assert count is not None  # by its form
    return count


def _recoded(line: str, codes: list[str]) -> str:
    """The line with other timecodes, and its end."""
    new = iter(codes)
    return (_CODE.sub(lambda _: next(new), line) if codes else line) + "\n"
