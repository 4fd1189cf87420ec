"""Drago et al. 2003, inverted: adaptive logarithmic mapping.

Eq. 4 is from memory and agrees with published implementations.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from itmo_video.model import Float32, Float64
from itmo_video.operators.base import FLOOR, Context, Floats, Parameter
from itmo_video.operators.luminance_operator import LuminanceOperator

_SAMPLES = 8192  # of the inverse: its error stays below that of float32


def forward(world: Floats, world_max: float, bias: float) -> Float64:
    """Eq. 4 with L_dmax = 100: display luminance in [0, 1] of world luminance in [0, world_max].

    ln(L_w + 1) / (log10(L_wmax + 1) * ln(2 + 8 (L_w / L_wmax)^(ln b / ln 0.5))).
    """
    world = np.asarray(world, np.float64)
    power = math.log(bias) / math.log(0.5)
    base = np.log(2 + 8 * (world / world_max) ** power)
    return np.asarray(np.log1p(world) / (math.log10(world_max + 1) * base))


def curve_drago2003(luminance: Floats, context: Context) -> Floats:
    """The inverse of `forward`, which has no closed form, by bisection to the last bit.

    The publication divides world luminance by the scene's adaptation, which cannot be derived from
    the picture: it is a parameter, in units of SDR white. L_wmax is L'max.
    """
    adaptation, bias = context.params["adaptation"], context.params["bias"]
    world_max = context.l_max / adaptation
    low, high = np.zeros(luminance.shape), np.full(luminance.shape, world_max)
    for _ in range(80):
        middle = (low + high) / 2
        below = forward(middle, world_max, bias) < luminance
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return np.asarray((low + high) / 2 * adaptation, luminance.dtype)


@lru_cache(maxsize=16)
def _gains(world_max: float, bias: float) -> Float32:
    """World over display luminance, sampled evenly in the fourth root of the latter, from 0 to 1.

    The fourth root, because the curve starts at black as a small power.
    """
    world = world_max * np.linspace(0, 1, 4 * _SAMPLES)[1:] ** 4
    display = forward(world, world_max, bias)
    wanted = np.maximum(np.linspace(0, 1, _SAMPLES + 1) ** 4, FLOOR)
    return np.asarray(np.interp(wanted, display, world / display), np.float32)


def gain_drago2003(luminance: Float32, context: Context) -> Float32:
    """`curve_drago2003` over L_d, from a table."""
    adaptation = context.params["adaptation"]
    table = _gains(context.l_max / adaptation, context.params["bias"])
    at = np.sqrt(np.sqrt(luminance))
    at *= np.float32(_SAMPLES)
    index = np.minimum(at.astype(np.int32), _SAMPLES - 1)
    at -= index
    low = table[index]
    low += at * (table[index + 1] - low)
    low *= np.float32(adaptation)
    return low


OPERATORS = (
    LuminanceOperator(
        "drago2003",
        "inverse of adaptive logarithmic mapping",
        "Drago, Myszkowski, Annen and Chiba, Adaptive logarithmic mapping for displaying high "
        "contrast scenes, Eurographics 2003",
        gain_drago2003,
        {
            "bias": Parameter(0.85, 0.5, 1.0, "the publication's bias b"),
            "adaptation": Parameter(1.0, 0.001, 1000.0, "the scene's adaptation, SDR white = 1"),
        },
        curve=curve_drago2003,
    ),
)
