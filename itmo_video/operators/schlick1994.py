"""Schlick 1994, inverted: rational quantisation.

The formula is from memory; the publication was not available.
"""

from __future__ import annotations

from itmo_video.operators.base import Context, Floats, Parameter, gain_of
from itmo_video.operators.luminance_operator import LuminanceOperator


def curve_schlick1994(luminance: Floats, context: Context) -> Floats:
    """Inverse of L_d = p L_w / ((p - 1) L_w + L_max): L_w = L_max L_d / (p - (p - 1) L_d).

    p is the slope at black; Schlick estimates it from the display's darkest grey, which cannot be
    derived from an SDR picture. p = 0 here means p = L'max: dark tones keep their luminance.
    """
    p = context.params["p"] or context.l_max
    return context.l_max * luminance / (p - (p - 1) * luminance)


OPERATORS = (
    LuminanceOperator(
        "schlick1994",
        "inverse of rational quantisation",
        "Schlick, Quantization techniques for visualization of high dynamic range pictures, "
        "Eurographics Workshop on Rendering 1994",
        gain_of(curve_schlick1994),
        {"p": Parameter(0.0, 0.0, 1e5, "slope of the forward curve at black; 0: the maximum")},
        curve=curve_schlick1994,
    ),
)
