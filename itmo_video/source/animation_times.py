"""The timing of an animation, read from its blocks, which also reveals truncated files."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from itmo_video.source import avif, png_chunks
from itmo_video.source.damage import DamageError
from itmo_video.source.gif_areas import read_areas
from itmo_video.source.gif_canvas import needs_alpha
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
    areas, has_end = read_areas(data)
    lengths = [area.delay_s for area in areas if area.is_whole]
    shown, is_changed = _shown(lengths)
    damage = None if has_end else "truncated: the last block is missing"
    return Timing(shown, len(lengths), damage, needs_alpha(areas), is_changed)


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
