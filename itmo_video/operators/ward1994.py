"""Ward 1994, inverted: a contrast-based scale factor.

The formula is from memory and agrees with published implementations.
"""

from __future__ import annotations

from itmo_video.operators.base import Context, Floats, Parameter, gain_of
from itmo_video.operators.luminance_operator import LuminanceOperator


def scale_factor(adaptation_nits: float, display_nits: float) -> float:
    """The factor m of L_d = m L_w: ((1.219 + (L_dmax / 2)^0.4) / (1.219 + L_wa^0.4))^2.5 / L_dmax.

    L_d is a share of L_dmax, L_w in cd/m2 (Ward 1994).
    """
    shown = 1.219 + (display_nits / 2) ** 0.4
    return float((shown / (1.219 + adaptation_nits**0.4)) ** 2.5) / display_nits


def curve_ward1994(luminance: Floats, context: Context) -> Floats:
    """L_d / m in units of the display's white, at most L'max at white.

    The scene's adaptation L_wa cannot be derived from the picture, so it is a parameter. The
    inverse is linear and has no L'max of its own.
    """
    display = context.params["display_nits"]
    gain = 1 / (scale_factor(context.params["adaptation_nits"], display) * display)
    return min(gain, context.l_max) * luminance


OPERATORS = (
    LuminanceOperator(
        "ward1994",
        "inverse of the contrast-based scale factor: linear, up to the maximum",
        "Ward, A contrast-based scalefactor for luminance display, Graphics Gems IV 1994",
        gain_of(curve_ward1994),
        {
            "adaptation_nits": Parameter(
                1000.0, 0.01, 1e5, "luminance the scene's viewer is adapted to"
            ),
            "display_nits": Parameter(100.0, 10.0, 1e4, "white of the display the picture is for"),
        },
        curve=curve_ward1994,
    ),
)
