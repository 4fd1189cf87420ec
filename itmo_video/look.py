"""Settings compiled for rendering, and what an operator may know of a frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from itmo_video.model import Float32
from itmo_video.operators import (
    Context,
    Operator,
    find_operator,
    frame_stats,
    geometric_mean,
    resolve_params,
)
from itmo_video.settings import Settings


@dataclass(frozen=True)
class Look:
    """Settings compiled for rendering: the operator with its parameters."""

    settings: Settings
    operator: Operator
    params: Mapping[str, float]

    @property
    def needs_map(self) -> bool:
        """Whether the Expand Map weighs the result."""
        return self.settings.expand_map and self.operator.uses_map


def make_look(settings: Settings) -> Look:
    """Compile settings; raises UsageError for an unknown operator or parameter."""
    operator = find_operator(settings)
    return Look(settings, operator, resolve_params(operator, settings.operator_params))


def context_of(luminance: Float32 | None, look: Look) -> Context:
    """What the look's operator may know of a frame; its luminance only where it is asked for."""
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
    )
