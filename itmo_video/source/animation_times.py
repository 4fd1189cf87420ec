"""The timing of an animation, read from its blocks, which also reveals truncated files."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

from itmo_video.source import avif, gif_canvas, png_chunks
from itmo_video.source.damage import DamageError
from itmo_video.source.still_formats import StillFormat

_SHORTEST_S, _INSTEAD_S = Fraction(1, 100), Fraction(1, 10)  # as browsers treat GIF and WebP
_MOST_FRAMES = 1 << 20


@dataclass(frozen=True)
class Timing:
    """The duration of each frame in seconds, and why the file is damaged, None if it is intact.

    `declared` is the number of frames in its header. `needs_alpha`: later frames may uncover the
    empty canvas.
    """

    lengths_s: tuple[Fraction, ...]
    declared: int
    damage: str | None = None
    needs_alpha: bool = False
    is_lengthened: bool = False


def timing(data: bytes, kind: StillFormat) -> Timing | None:
    """The timing of an animation; None for stills, and for formats without animations."""
    if kind == "webp":
        found = _webp(data)
    elif kind == "gif":
        found = _gif(data)
    elif kind == "apng":
        found = _apng(data)
    elif kind == "avif" and b"avis" in data[:64]:
        found = _avif(data)
    else:
        return None
    return found if max(found.declared, len(found.lengths_s)) > 1 else None


def _shown(lengths: list[Fraction]) -> tuple[tuple[Fraction, ...], bool]:
    shown = tuple(_INSTEAD_S if length <= _SHORTEST_S else length for length in lengths)
    return shown, shown != tuple(lengths)


def _webp(data: bytes) -> Timing:
    lengths: list[Fraction] = []
    damage = None
    at, end = 12, 8 + int.from_bytes(data[4:8], "little")
    if end > len(data):
        damage = f"truncated: {end - len(data)} bytes are missing"
    while at + 8 <= min(end, len(data)) and len(lengths) < _MOST_FRAMES:
        size = int.from_bytes(data[at + 4 : at + 8], "little")
        if data[at : at + 4] == b"ANMF":
            ms = int.from_bytes(data[at + 20 : at + 23], "little")
            lengths.append(Fraction(ms, 1000))
        at += 8 + size + size % 2
    shown, is_changed = _shown(lengths)
    return Timing(shown, len(lengths), damage, is_lengthened=is_changed)


def _gif(data: bytes) -> Timing:
    lengths: list[Fraction] = []
    needs_alpha, damage = False, "truncated: the last block is missing"
    delay, disposal, has_clear = Fraction(0), 0, False
    for kind, body in _gif_blocks(data):
        if kind == 0x3B:
            damage = ""
            break
        if kind == 0xF9 and len(body) >= 4:
            delay = Fraction(int.from_bytes(body[1:3], "little"), 100)
            disposal, has_clear = body[0] >> 2 & 7, bool(body[0] & 1)
        elif kind == 0x2C:
            lengths.append(delay)
            needs_alpha = needs_alpha or (disposal == 2 and has_clear)
            delay, disposal, has_clear = Fraction(0), 0, False
    shown, is_changed = _shown(lengths)
    needs_alpha = needs_alpha or gif_canvas.uncovers(data)
    return Timing(shown, len(lengths), damage or None, needs_alpha, is_changed)


def _gif_blocks(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Extensions (by label, first sub-block), images (0x2C) and the trailer (GIF89a, 12 to 27)."""
    at = 13 + (3 << (data[10] & 7) + 1 if len(data) > 10 and data[10] & 0x80 else 0)
    while at < len(data):
        kind = data[at]
        if kind == 0x3B:
            yield kind, b""
            return
        if kind == 0x2C:
            if at + 10 > len(data):
                return
            flags = data[at + 9]
            body_at = at + 11 + (3 << (flags & 7) + 1 if flags & 0x80 else 0)
            label = kind
        elif kind == 0x21:
            body_at, label = at + 2, data[at + 1] if at + 1 < len(data) else 0
        else:
            at += 1  # padding between blocks, which some writers leave
            continue
        first = data[body_at + 1 : body_at + 1 + data[body_at]] if body_at < len(data) else b""
        at = body_at
        while at < len(data) and data[at]:
            at += data[at] + 1
        if at >= len(data):
            return
        at += 1
        yield label, first


def _apng(data: bytes) -> Timing:
    try:
        facts = png_chunks.read_facts(data)
    except DamageError as error:
        return Timing((), 2, str(error))
    shown, is_changed = _shown(facts.delays_s)
    damage = None
    if len(shown) < facts.frames:
        missing = facts.frames - len(shown)
        damage = f"truncated: {missing} of {facts.frames} frames are missing"
    return Timing(shown, facts.frames, damage, is_lengthened=is_changed)


def _avif(data: bytes) -> Timing:
    times, end = avif.frame_times(data)
    if not times:
        return Timing((), 2, "the timing of its frames cannot be read")
    lengths = tuple(b - a for a, b in zip(times, (*times[1:], end), strict=True))
    return Timing(tuple(max(length, Fraction(1, 1000)) for length in lengths), len(times))
