"""Huo et al. 2014: the retina's response, inverted, with local adaptation.

The formula and its constants are from memory and agree with the HDR Toolbox by Banterle et al.
"""

from __future__ import annotations

import numpy as np

from itmo_video.model import Float32
from itmo_video.operators.base import Context, Floats, Parameter
from itmo_video.operators.bilateral_grid import cross_bilateral
from itmo_video.operators.luminance_operator import LuminanceOperator


def adapted(local: Floats | float, context: Context) -> Floats:
    """(L_s^n + sigma^n)^(1/n), with sigma the frame's geometric mean, both relative to L'max."""
    n, sigma = context.params["n"], context.frame.geometric_mean
    return np.asarray((np.asarray(local) ** n + sigma**n) ** (1 / n))


def gain_huo2014(luminance: Float32, context: Context) -> Float32:
    """L'max over the frame's maximum: the gain in white surroundings.

    The scale departs from the publication, with which L'max times `adapted(1)` would be exceeded.
    """
    return np.full_like(luminance, context.l_max / max(context.frame.maximum, 1e-3))


def curve_huo2014(luminance: Floats, context: Context) -> Floats:
    """L_d * L'max / L_max: the expanded luminance in white surroundings."""
    return luminance * (context.l_max / max(context.frame.maximum, 1e-3))


def base_huo2014(context: Context) -> float:
    """The gain in black surroundings: L'max / L_max * adapted(0) / adapted(1)."""
    peak = context.l_max / max(context.frame.maximum, 1e-3)
    return peak * float(adapted(0.0, context) / adapted(1.0, context))


def map_huo2014(luminance: Float32, context: Context) -> Float32:
    """The position of `adapted` of local luminance from black (0) to white (1): float32 (H, W).

    Local luminance is smoothed by two bilateral filters, of 16 pixels and 0.3, then 10 and 0.1. The
    publication does not give the picture size for these; here it is that of the analysis picture.
    """
    local = cross_bilateral(luminance, luminance, 16.0, 0.3)
    local = cross_bilateral(local, local, 10.0, 0.1)
    low, high = adapted(0.0, context), adapted(1.0, context)
    share = (adapted(local.astype(np.float64), context) - low) / (high - low)
    return np.asarray(np.clip(share, 0, 1), np.float32)


OPERATORS = (
    LuminanceOperator(
        "huo2014",
        "inverse of the retina's response, adapted to the local luminance",
        "Huo, Yang, Dong and Brost, Physiological inverse tone mapping based on retina response, "
        "The Visual Computer 30, 2014",
        gain_huo2014,
        {"n": Parameter(0.86, 0.2, 2.0, "sensitivity of the response")},
        needs_stats=True,
        curve=curve_huo2014,
        make_map=map_huo2014,
        base=base_huo2014,
    ),
)
