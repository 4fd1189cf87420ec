"""Suggesting settings for a clip by rules of thumb, each with a reason.

Reported, never applied; what the settings in use have already is left out. Those for the Expand
Map are given for the operator banterle2006 alone, with which they were measured
(docs/quality.md); the numbers of the others are rules of thumb.
"""

from __future__ import annotations

from pathlib import Path

from itmo_video.analysis.model import Statistics, Suggestion
from itmo_video.model import ClipInfo
from itmo_video.settings import Settings

FEW_CLIPPED = 0.0005
MANY_CLIPPED = 0.06
DARK, BRIGHT = 0.1, 0.3  # of white; the median of ordinary pictures lies between
VERY_DARK = 0.05
FAST_CHANGE = 0.02  # mean difference of neighbouring frames, 0 to 1
SLOW_CHANGE = 0.002
FEW_BITS = 0.06  # per pixel


def suggestions(
    info: ClipInfo, statistics: Statistics, settings: Settings
) -> tuple[Suggestion, ...]:
    """Suggest settings by a clip's metadata and statistics; empty if those in use fit."""
    of_the_map = [_peak(statistics), *_map(statistics), _l_white(statistics)]
    found = [
        *(of_the_map if settings.operator == "banterle2006" else ()),
        _keys(statistics),
        _noise(info),
        _projection(info),
    ]
    return tuple(
        suggestion
        for suggestion in found
        if suggestion is not None and getattr(settings, suggestion.setting) != suggestion.value
    )


def _peak(statistics: Statistics) -> Suggestion | None:
    if statistics.p50 >= VERY_DARK:
        return None
    reason = f"half of the picture is below {statistics.p50:.1%} of white"
    return Suggestion("peak_nits", 600.0, f"{reason}: a high peak would expand lit areas too far")


def _map(statistics: Statistics) -> tuple[Suggestion, ...]:
    share = f"{statistics.clipped:.2%} of the pixels are at white"
    if statistics.clipped < FEW_CLIPPED:
        reason = f"{share}: little is clipped, so the paper's map suits"
        return Suggestion("radius", 16.0, reason), Suggestion("min_lights", 4, reason)
    if statistics.clipped > MANY_CLIPPED:
        reason = f"{share}: large areas clip, so a stricter light threshold is needed"
        return (Suggestion("min_lights", 4, reason),)
    if statistics.p50 > DARK:
        reason = f"half of the picture is above {statistics.p50:.0%} of white, highlights are large"
        return (Suggestion("radius", 8.0, reason),)
    return ()


def _l_white(statistics: Statistics) -> Suggestion | None:
    if not DARK < statistics.p50 <= BRIGHT:
        return None
    tone = f"the median is {statistics.p50:.0%} of white"
    reason = f"{tone}; this keeps it steady next to lamps"
    return Suggestion("l_white", 12.0, reason)


def _keys(statistics: Statistics) -> Suggestion | None:
    told = f"frames differ by {statistics.change:.2%} on average"
    if statistics.change > FAST_CHANGE:
        return Suggestion("key_interval", 3, f"{told}: fast motion needs keyframes closer together")
    if statistics.change < SLOW_CHANGE:
        return Suggestion("key_interval", 10, f"{told}: slow motion needs fewer keyframes")
    return None


def _noise(info: ClipInfo) -> Suggestion | None:
    try:
        size = Path(info.path).stat().st_size
    except OSError:
        return None
    bits = 8 * size / max(1, info.frames * info.width * info.height)
    if bits >= FEW_BITS:
        return None
    reason = f"{bits:.3f} bits per pixel: expansion would show blocking and banding"
    return Suggestion("noise_guard", True, reason)


def _projection(info: ClipInfo) -> Suggestion | None:
    width, height = info.display_size
    if width != 2 * height or width < 2048:
        return None
    return Suggestion("projection", "latlong", "twice as wide as high: perhaps a panorama")
