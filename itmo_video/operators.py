"""Inverse tone mapping operators as gains: expanded luminance over display luminance.

An operator is a pure function of luminance in [0, 1] and a context; it has no state between
frames. Eq. 3 keeps the hue by multiplying all three channels by the same ratio L_w / L_d, so that
ratio is what an operator returns: it stays finite where L_d is 0, and no division by zero occurs.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from itmo_video.errors import UsageError
from itmo_video.model import Float32
from itmo_video.settings import Settings

LUMINANCE_WEIGHTS = (0.213, 0.715, 0.072)  # eq. 1
DELTA = 1e-3  # eq. 5; reproduces Table 1's Memorial to 1 %


@dataclass(frozen=True)
class Context:
    """What an operator may know: maxima in units of SDR white, and its own parameters.

    `alpha` and `geometric_mean` (eq. 5, of the frame) are set only where the user gave alpha.
    """

    l_max: float
    l_white: float
    params: Mapping[str, float] = field(default_factory=dict)
    alpha: float | None = None
    geometric_mean: float | None = None

    @property
    def scale(self) -> float | None:
        """L_mean / alpha of eqs. 4 and 9, or None where eq. 13 makes the mean cancel."""
        if self.alpha is None:
            return None
        if self.geometric_mean is None:
            raise ValueError("alpha is set, so the frame's geometric mean is needed")
        return self.geometric_mean / self.alpha


@dataclass(frozen=True)
class Parameter:
    """An operator's own parameter: its default, bounds and meaning."""

    default: float
    lower: float
    upper: float
    help: str


@dataclass(frozen=True)
class Operator:
    """A named operator: its gain, where it was published, and what it takes.

    `gain(luminance, context)` takes float32 in [0, 1] and returns float32 of the same shape;
    `uses_map` tells whether the Expand Map weighs its result against the LDR picture.
    """

    name: str
    summary: str
    source: str
    gain: Callable[[Float32, Context], Float32]
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    uses_map: bool = True
    uses_alpha: bool = False


def geometric_mean(luminance: Float32, delta: float = DELTA) -> float:
    """Eq. 5: exp of the mean of log(delta + L_w) over the frame; luminance is linear."""
    return float(np.exp(np.mean(np.log(delta + luminance.astype(np.float64)))))


def gain_banterle2006(luminance: Float32, context: Context) -> Float32:
    """Eq. 11's positive root over L_d, with alpha from eq. 13 unless the user gave one.

    With eq. 13 the geometric mean cancels: L_w(1) = L'max and the slope at 0 is L'max / L_white.
    A given alpha stands for L'max = L_white * mean / alpha (eq. 12). The root is written as
    2 L_d / ((1 - L_d) + sqrt(D)), which does not cancel in float32 for dark pixels.
    """
    scale = context.scale
    l_max = context.l_max if scale is None else context.l_white * scale
    c = np.float32(4.0 / context.l_white**2)
    u = np.float32(1) - luminance
    root: Float32 = np.sqrt(u * u + c * luminance)
    root += u
    np.divide(np.float32(2.0 * l_max / context.l_white), root, out=root)
    return root


def gain_reinhard2002(luminance: Float32, context: Context) -> Float32:
    """Eq. 9 over L_d with damping: scale / (1 - L_d + damping), so that white stays finite.

    The paper asks for "a damping factor" without giving one: ours makes L_w(1) = L'max exactly.
    Without alpha the scale L_mean / alpha is 1, so dark tones keep their luminance.
    """
    scale = context.scale if context.scale is not None else 1.0
    damping = np.float32(scale / context.l_max)
    return np.asarray(np.float32(scale) / (np.float32(1) - luminance + damping), np.float32)


def gain_landis2002(luminance: Float32, context: Context) -> Float32:
    """The naive operator: from a threshold up, exponentially to L'max (Landis 2002).

    The course notes give no formula: ours is L_d * L'max^t with t from 0 at the threshold to 1 at
    white, continuous, and exactly L_d below.
    """
    threshold = context.params["threshold"]
    t = np.clip((luminance - threshold) / max(1.0 - threshold, 1e-6), 0, 1)
    return np.asarray(np.exp(t * np.float32(np.log(context.l_max))), np.float32)


def gain_linear(luminance: Float32, context: Context) -> Float32:
    """Everything multiplied by L'max."""
    return np.full_like(luminance, context.l_max)


_PAPER = "Banterle, Ledda, Debattista and Chalmers, Inverse Tone Mapping, GRAPHITE 2006"

OPERATORS: dict[str, Operator] = {
    op.name: op
    for op in (
        Operator(
            "banterle2006",
            "inverse of the global photographic operator, with white point",
            f"{_PAPER}, eq. 11 and 13",
            gain_banterle2006,
            uses_alpha=True,
        ),
        Operator(
            "landis2002",
            "the naive one: exponentially to the maximum above a threshold",
            "Landis, Production-ready global illumination, SIGGRAPH 2002 course notes 16",
            gain_landis2002,
            {"threshold": Parameter(0.5, 0.0, 0.999, "luminance from which it expands")},
        ),
        Operator(
            "linear",
            "everything multiplied by the maximum, without the map",
            "for comparison",
            gain_linear,
            uses_map=False,
        ),
        Operator(
            "reinhard2002",
            "inverse of the global photographic operator without white point, damped",
            f"{_PAPER}, eq. 9",
            gain_reinhard2002,
            uses_alpha=True,
        ),
    )
}


def find_operator(settings: Settings) -> Operator:
    """The operator that the settings name; raises UsageError for unknown names and parameters."""
    operator = OPERATORS.get(settings.operator)
    if operator is None:
        raise UsageError(
            f"unknown operator {settings.operator!r}", remedy=f"Known: {', '.join(OPERATORS)}"
        )
    if settings.alpha is not None and not operator.uses_alpha:
        raise UsageError(f"operator {operator.name} does not use alpha")
    return operator


def resolve_params(operator: Operator, given: Mapping[str, float]) -> dict[str, float]:
    """All parameters of an operator, defaults filled in; raises UsageError where out of bounds."""
    params = {name: p.default for name, p in operator.parameters.items()}
    for name, value in given.items():
        spec = operator.parameters.get(name)
        if spec is None:
            known = ", ".join(operator.parameters) or "none"
            raise UsageError(
                f"operator {operator.name} has no parameter {name!r}", remedy=f"Known: {known}"
            )
        if not isinstance(value, int | float) or not spec.lower <= value <= spec.upper:
            raise UsageError(f"{name} must be from {spec.lower:g} to {spec.upper:g}, not {value!r}")
        params[name] = float(value)
    return params
