"""Whether the setting `lamps` can have an effect: only in footage that was tone-mapped."""

from __future__ import annotations

from collections.abc import Mapping

from itmo_video.errors import ItmoError
from itmo_video.operators.auto_rendering import Rendering, rendering_of_frame
from itmo_video.settings import Settings
from itmo_video.source.clip import Clip

_DEFAULT = Settings().lamps


def lamps_count(found: Rendering, settings: Settings) -> bool:
    """Whether `lamps` changes footage of this rendering; also True at its default.

    It is part of eq. 11's weight, which is 0 unless highlights were tone-mapped, and counts at
    night, above 1 also in daylight (`auto_rendering.curve_weight`).
    """
    if not _is_set(settings):
        return True
    is_asked = settings.expand_map and found.tone_mapped > 0
    return is_asked and (found.night > 0 or settings.lamps > 1)


def lamps_notices(clip: Clip, numbers: Mapping[int, int], settings: Settings) -> list[str]:
    """A notice if `lamps` has no effect in the first frame, by its number, or none."""
    if not (numbers and _is_set(settings) and settings.expand_map):
        return []  # without a map, the look says that it has no effect
    number = min(numbers)
    try:
        frame = next(clip.frames(numbers[number]), None)
    except ItmoError:  # the conversion itself reports it
        return []
    if frame is None:
        return []
    found = rendering_of_frame(frame, settings.map_width, settings.footage)
    if settings.footage == "clipped" or lamps_count(found, settings):
        return []
    if found.tone_mapped > 0:
        why, remedy = "it is no night scene", "above 1 it counts in daylight, too"
    else:
        why, remedy = "it does not seem tone-mapped", "--footage tone-mapped overrides this"
    return [
        f"lamps has no effect in shots like that of frame {number}: {why} (`analyse` shows each "
        f"shot; {remedy})"
    ]


def _is_set(settings: Settings) -> bool:
    return settings.operator == "auto" and settings.lamps != _DEFAULT
