"""A shot's own settings as plain names and values, and back: what a shot list can say of a shot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from itmo_video.analysis.model import Shot
from itmo_video.errors import UsageError
from itmo_video.settings import Settings

NAMES = ("peak_nits", "l_max", "strength")


def own_of(shot: Shot, base: Settings) -> dict[str, Any]:
    """What the shot sets for itself, as the clip's settings would say it."""
    own: dict[str, Any] = {}
    if shot.peak_nits is not None:
        own["peak_nits"] = shot.peak_nits
    if shot.l_max is not None:
        own["l_max"] = shot.l_max
    if shot.strength != 1.0:
        own["strength"] = base.strength * shot.strength
    return own


def with_own(shot: Shot, own: Mapping[str, Any], base: Settings) -> Shot:
    """The shot with these own settings and no others; UsageError for what a shot cannot set."""
    if unknown := sorted(set(own) - set(NAMES)):
        raise UsageError(f"a shot cannot have its own {', '.join(unknown)}")
    strength = own.get("strength", base.strength)
    share = strength / base.strength if base.strength > 0 else 1.0
    if not 0 <= share <= 1:
        raise UsageError(
            f"a shot's strength is at most the clip's, {base.strength:g}",
            remedy="Raise the clip's, and lower it in the other shots.",
        )
    return replace(shot, peak_nits=own.get("peak_nits"), l_max=own.get("l_max"), strength=share)
