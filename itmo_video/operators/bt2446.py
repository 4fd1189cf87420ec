"""ITU-R BT.2446 methods A and C, SDR to HDR.

Tables and constants are from memory; tests check them against the conditions that the report
derives them from, and method A against its forward form.
"""

from __future__ import annotations

import math

import numpy as np

from itmo_video.operators.base import Context, Floats, Parameter, gain_of
from itmo_video.operators.luminance_operator import LuminanceOperator

_REPORT = "Report ITU-R BT.2446-1 (2021)"
_A_WHITE = 255.0 ** (2.8305e-6 * 255**2 - 7.4622e-4 * 255 + 1.2528)  # 999.8 of 1000

K1, K3 = 0.83802, 0.74204  # method C, section 6.1.4
KNEE = 100 * 0.8**2.4  # cd/m2 of SDR, the report's 58.5
K2 = KNEE * (1 - K3)  # 15.0997: the log branch meets the line in value and slope
K4 = KNEE - K2 * math.log(1 - K3)  # 78.9944
KNEE_HDR = KNEE / K1


def curve_bt2446a(luminance: Floats, context: Context) -> Floats:
    """Table 4: Y'' = 255 Y', Y'_hdr = Y''^E with E a quadratic of Y'' on either side of 70.

    Y' and Y'_hdr are of gamma 2.4; the result is for 100 to 1000 cd/m2 and is scaled so that white
    is L'max (at 1000 cd/m2 over 203 it is the report's own luminance). Departs from the report:
    applied to luminance, not luma, with the hue kept by eq. 3 in place of its 1.075 on chroma.
    """
    y = 255 * luminance ** (1 / 2.4)
    low = (1.8712e-5 * y - 2.7334e-3) * y + 1.3141
    high = (2.8305e-6 * y - 7.4622e-4) * y + 1.2528
    expanded = np.asarray(y ** np.where(y <= 70, low, high) / _A_WHITE)
    return context.l_max * expanded**2.4


def curve_bt2446c(luminance: Floats, context: Context) -> Floats:
    """The inverse of section 6.1.4's curve in units of HDR reference white, at most L'max.

    The report's curve is absolute and has no L'max: SDR white, 100 cd/m2, becomes 332. (Its peak
    of 1000 is reached by SDR codes of 109 %.) Departs from the report: no crosstalk matrix, and
    luminance alone.
    """
    sdr = 100 * luminance
    above = np.maximum(sdr, KNEE)
    hdr = np.where(sdr < KNEE, sdr / K1, KNEE_HDR * (np.exp((above - K4) / K2) + K3))
    return np.asarray(np.minimum(hdr / context.params["reference_nits"], context.l_max))


OPERATORS = (
    LuminanceOperator(
        "bt2446a",
        "ITU-R BT.2446 method A, SDR to HDR",
        f"{_REPORT}, section 4.2, table 4",
        gain_of(curve_bt2446a),
        uses_map=False,
        curve=curve_bt2446a,
    ),
    LuminanceOperator(
        "bt2446c",
        "ITU-R BT.2446 method C, SDR to HDR: absolute, white at 332 cd/m2",
        f"{_REPORT}, section 6.2",
        gain_of(curve_bt2446c),
        {"reference_nits": Parameter(203.0, 50.0, 1000.0, "luminance that 1.0 stands for")},
        uses_map=False,
        curve=curve_bt2446c,
    ),
)
