"""Banterle et al. 2007: the 2006 operator with an edge-aware Expand Map.

The map is computed from luminance, or one from each colour channel separately.

From memory of the publication; the HDR Toolbox by Banterle et al. computes maps of channels in
the same way.
"""

from __future__ import annotations

import numpy as np

from itmo_video.model import Float32
from itmo_video.operators.base import Context, Parameter, code_of_light
from itmo_video.operators.bilateral_grid import cross_bilateral
from itmo_video.operators.luminance_operator import LuminanceOperator
from itmo_video.operators.photographic import curve_banterle2006, gain_banterle2006


def map_banterle2007(luminance: Float32, context: Context) -> Float32:
    """The Expand Map with the current settings, cross-bilaterally filtered along luminance codes.

    Float32 (H, W) in [0, 1]. The publication gives no filter sizes; here they are parameters. With
    maps per channel `luminance` is that channel, also for the edges.
    """
    if context.density is None:
        raise ValueError("this operator needs the Expand Map")
    sigma_px = max(1.0, context.params["sigma_space"] * luminance.shape[1] / 512)
    return np.asarray(
        cross_bilateral(
            context.density(luminance),
            code_of_light(luminance),
            sigma_px,
            context.params["sigma_range"] / 255,
        )
    )


_SOURCE = (
    "Banterle, Ledda, Debattista, Chalmers and Bloj, A framework for inverse tone mapping, "
    "The Visual Computer 23, 2007"
)
_FILTER = {
    "sigma_range": Parameter(25.0, 1.0, 255.0, "of luminance, in codes"),
    "sigma_space": Parameter(8.0, 1.0, 200.0, "in pixels of a picture 512 wide"),
}

OPERATORS = (
    LuminanceOperator(
        "banterle2007",
        "banterle2006 with an Expand Map filtered along the picture's edges",
        _SOURCE,
        gain_banterle2006,
        _FILTER,
        uses_alpha=True,
        uses_l_white=True,
        curve=curve_banterle2006,
        make_map=map_banterle2007,
    ),
    LuminanceOperator(
        "banterle2007_channels",
        "banterle2007 with a map per colour channel, which changes hues at lights",
        _SOURCE,
        gain_banterle2006,
        _FILTER,
        uses_alpha=True,
        uses_l_white=True,
        curve=curve_banterle2006,
        make_map=map_banterle2007,
        channel_maps=True,
    ),
)
