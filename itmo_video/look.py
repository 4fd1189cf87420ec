"""Settings compiled for rendering, and the context of an operator."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from itmo_video.model import Float32
from itmo_video.operators import (
    Context,
    Operator,
    find_operator,
    frame_stats,
    geometric_mean,
    resolve_params,
)
from itmo_video.options import flag_name
from itmo_video.settings import Settings
from itmo_video.words import has_or_have

_OF_MAP = ("lights", "min_lights", "soft_lights")  # and the radius, which guards use, too


@dataclass(frozen=True)
class Look:
    """Settings compiled for rendering: the operator with its parameters."""

    settings: Settings
    operator: Operator
    params: Mapping[str, float]

    @property
    def needs_map(self) -> bool:
        """Whether the Expand Map weights the result."""
        return self.settings.expand_map and self.operator.uses_map

    def settings_in_use(self) -> dict[str, Any]:
        """The settings that this look's frames depend on, as plain values by name.

        Derived values are resolved and all parameters of the operator are included; settings that
        have no effect with the operator or other settings are not.
        """
        values = self.settings.as_dict() | {"operator_params": dict(self.params)}
        unset = {name for name, value in values.items() if value in (None, [], {})}
        return {n: value for n, value in values.items() if n not in unset | self._idle}

    @property
    def notices(self) -> tuple[str, ...]:
        """A notice about settings that were given (make_settings) but have no effect."""
        _, overrides = self.settings.asked or ({}, {})
        idle = [flag_name(name) for name in overrides if name in self._idle]
        if not idle:
            return ()
        about = f"operator {self.settings.operator}"
        about += "" if self.needs_map else ", no Expand Map"
        if self.needs_map and "lamps" in idle and self.operator.sees == "rgb":
            about += ", footage clipped"
        named = f"{', '.join(sorted(idle))} {has_or_have(len(idle))}"
        return (f"{named} no effect with these settings ({about})",)

    @property
    def _idle(self) -> set[str]:
        """The settings that have no effect with the operator or another setting."""
        settings, operator, idle = self.settings, self.operator, set[str]()
        if not self.needs_map:
            idle |= {*_OF_MAP, "edge_aware", "key_interval", "temporal", "smooth_keys"}
            idle |= {"footage", "lamps"}  # which say what an operator's own map is
            if not settings.noise_guard:
                idle |= {"radius", "map_width", "projection"}
        elif operator.sees == "rgb":
            idle |= {*_OF_MAP, "edge_aware"}
            idle |= set() if settings.noise_guard else {"radius"}
        if operator.sees != "rgb":
            idle |= {"footage", "hue", "lamps"}
        elif settings.footage == "clipped":
            idle.add("lamps")
        if settings.temporal == "per-frame":
            idle.add("key_interval")
        if settings.temporal != "tracked":
            idle.add("smooth_keys")
        if settings.l_max is not None:
            idle.add("peak_nits")
        if not operator.uses_l_white:
            idle.add("l_white")
        return idle


def make_look(settings: Settings) -> Look:
    """Compile settings; raises UsageError for an unknown operator or parameter."""
    operator = find_operator(settings)
    return Look(settings, operator, resolve_params(operator, settings.operator_params))


def context_of(luminance: Float32 | None, look: Look) -> Context:
    """The context of a frame for the look's operator; luminance only if it is needed."""
    settings, stats, mean = look.settings, None, None
    if luminance is not None:
        stats = frame_stats(luminance) if look.operator.needs_stats else None
        mean = geometric_mean(luminance) if settings.alpha is not None else None
    return Context(
        settings.l_max_effective,
        settings.l_white_effective,
        look.params,
        settings.alpha,
        mean,
        stats,
        settings.hue,
        settings.lamps,
        settings.footage,
    )
