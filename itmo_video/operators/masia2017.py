"""Masia et al. 2017: a power whose exponent follows from the frame's statistics.

The regression (eq. 5) is from memory and agrees with the HDR Toolbox by Banterle et al.
"""

from __future__ import annotations

import math

from itmo_video.operators.base import Context, Floats, Parameter, gain_of
from itmo_video.operators.luminance_operator import LuminanceOperator


def exponent(context: Context) -> float:
    """Gamma = 2.4379 + 0.2319 ln L_H - 1.1228 k + 0.0085 p_ov (eq. 5), within bounds.

    L_H is the geometric mean, k the key, p_ov the percentage of over-exposed pixels. Whether L_H
    refers to codes or light is ambiguous: here it is of linear luminance. The regression may give 0
    or less, which would invert the picture, so `gamma_min` is its lower bound.
    """
    frame = context.frame
    gamma = 2.4379 + 0.2319 * math.log(frame.geometric_mean)
    gamma += -1.1228 * frame.key + 0.0085 * 100 * frame.over_share
    return min(max(gamma, context.params["gamma_min"]), 5.0)


def curve_masia2017(luminance: Floats, context: Context) -> Floats:
    """L'max * L_d^gamma."""
    return context.l_max * luminance ** exponent(context)


OPERATORS = (
    LuminanceOperator(
        "masia2017",
        "a power of luminance whose exponent follows from the frame's key and exposure",
        "Masia, Serrano and Gutierrez, Dynamic range expansion based on image statistics, "
        "Multimedia Tools and Applications 76, 2017",
        gain_of(curve_masia2017),
        {"gamma_min": Parameter(0.5, 0.1, 2.0, "lower bound of the exponent")},
        uses_map=False,
        needs_stats=True,
        curve=curve_masia2017,
    ),
)
