"""Banterle et al. 2007: the 2006 operator with an Expand Map that follows the picture's edges."""

from __future__ import annotations

import numpy as np

from itmo_video.model import Float32
from itmo_video.operators.base import Context, Operator, Parameter, code_of_light
from itmo_video.operators.bilateral_grid import cross_bilateral
from itmo_video.operators.photographic import curve_banterle2006, gain_banterle2006


def map_banterle2007(luminance: Float32, context: Context) -> Float32:
    """The Expand Map by the settings at hand, cross-bilaterally filtered along luminance codes.

    Float32 (H, W) in [0, 1]. The publication filters along edges without giving sizes: ours are
    parameters. Its maps of single colour channels are left out: an operator has luminance only.
    """
    if context.density is None:
        raise ValueError("the Expand Map of the settings is needed to make this one")
    sigma_px = max(1.0, context.params["sigma_space"] * luminance.shape[1] / 512)
    return np.asarray(
        cross_bilateral(
            context.density(luminance),
            code_of_light(luminance),
            sigma_px,
            context.params["sigma_range"] / 255,
        )
    )


OPERATORS = (
    Operator(
        "banterle2007",
        "banterle2006 with the Expand Map filtered along the picture's edges",
        "Banterle, Ledda, Debattista, Chalmers and Bloj, A framework for inverse tone mapping, "
        "The Visual Computer 23, 2007",
        gain_banterle2006,
        {
            "sigma_range": Parameter(25.0, 1.0, 255.0, "of luminance, in codes"),
            "sigma_space": Parameter(8.0, 1.0, 200.0, "in pixels of a picture 512 wide"),
        },
        uses_alpha=True,
        curve=curve_banterle2006,
        make_map=map_banterle2007,
    ),
)
