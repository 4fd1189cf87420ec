"""Akyuz et al. 2007: linear scaling, or a power, of the frame's range.

The formula is from memory and agrees with the HDR Toolbox by Banterle et al.; the publication was
not available.
"""

from __future__ import annotations

import numpy as np

from itmo_video.operators.base import Context, Floats, Parameter, gain_of
from itmo_video.operators.luminance_operator import LuminanceOperator


def curve_akyuz2007(luminance: Floats, context: Context) -> Floats:
    """L'max * ((L_d - L_min) / (L_max - L_min))^gamma, with the frame's own extremes (eq. 1).

    For a frame of constant luminance the quotient is undefined and taken as L_d.
    """
    low, high = context.frame.minimum, context.frame.maximum
    if high - low < 1e-6:
        low, high = 0.0, 1.0
    share = np.clip((luminance - low) / (high - low), 0, 1)
    return np.asarray(context.l_max * share ** context.params["gamma"])


OPERATORS = (
    LuminanceOperator(
        "akyuz2007",
        "the frame's range scaled to the maximum",
        "Akyuz, Fleming, Riecke, Reinhard and Buelthoff, Do HDR displays support LDR content?, "
        "ACM TOG 26(3) 2007",
        gain_of(curve_akyuz2007),
        {"gamma": Parameter(1.0, 0.1, 10.0, "power; 1, linear, was preferred in their study")},
        uses_map=False,
        needs_stats=True,
        curve=curve_akyuz2007,
    ),
)
