"""Meylan et al. 2006: two straight lines, diffuse up to a threshold and specular above.

From memory; slopes, 0.67 and the filter size agree with the HDR Toolbox by Banterle et al.
"""

from __future__ import annotations

import numpy as np

from itmo_video.operators.base import Context, Floats, Parameter, gain_of
from itmo_video.operators.luminance_operator import LuminanceOperator

_HIGHEST = 0.99  # a threshold at white would leave no room for the specular line


def curve_meylan2006(luminance: Floats, context: Context) -> Floats:
    """s1 * L_d up to omega, s1 * omega + s2 * (L_d - omega) above; s1 = rho * L'max / omega.

    s2 = (1 - rho) * L'max / (L_max - omega). The publication finds omega as the smallest
    luminance of a specular mask, which starts from the maximum of the low-passed frame and is
    refined by erosion and dilation; ours is that maximum, without refinement and without smoothing
    the transition, and L_max is white, so that the line ends at L'max.
    """
    rho = context.params["diffuse_share"]
    omega = min(max(context.frame.diffuse_white, 0.01), _HIGHEST)
    s1 = rho * context.l_max / omega
    s2 = (1 - rho) * context.l_max / (1 - omega)
    return np.asarray(s1 * np.minimum(luminance, omega) + s2 * np.maximum(luminance - omega, 0))


OPERATORS = (
    LuminanceOperator(
        "meylan2006",
        "two lines: diffuse up to the brightest local mean, specular above",
        "Meylan, Daly and Suesstrunk, The reproduction of specular highlights on high dynamic "
        "range displays, CIC 2006",
        gain_of(curve_meylan2006),
        {
            "diffuse_share": Parameter(
                0.67, 0.05, 0.95, "share of the output range for diffuse tones"
            )
        },
        uses_map=False,
        needs_stats=True,
        curve=curve_meylan2006,
    ),
)
