"""Log encodings for grading, from linear light: ACEScct and ARRI LogC3, as published.

1.0 is SDR white, taken as a perfect diffuser (scene-linear 1.0).
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any, Literal

import cv2
import numpy as np

from itmo_video.colour.primaries import rgb_to_rgb_matrix
from itmo_video.delivery.half_tables import all_halves, looked_up
from itmo_video.delivery.ycbcr import Planes
from itmo_video.model import Float32, Float64, Half

LogCurve = Literal["acescct", "logc3"]
PRIMARIES: dict[LogCurve, str] = {"acescct": "acescg", "logc3": "alexa_wide_gamut"}
TOLD: dict[LogCurve, str] = {
    "acescct": "ACEScct, AP1 primaries, video levels",
    "logc3": "ARRI LogC3 EI 800, ALEXA Wide Gamut RGB, video levels",
}


def acescct(linear: Float64 | Float32) -> Float64:
    """ACEScct of linear AP1 light (AMPAS S-2016-001, 4.4): 0.18 gives 0.4136."""
    x = np.asarray(linear, np.float64)
    log = (np.log2(np.maximum(x, 0.0078125)) + 9.72) / 17.52
    return np.where(x <= 0.0078125, 10.5402377416545 * x + 0.0729055341958355, log)


def logc3(linear: Float64 | Float32) -> Float64:
    """LogC3 of linear scene light, EI 800 (ARRI 2012, V3): 0.18 gives 0.3910."""
    a, b, c, d, e, f, cut = 5.555556, 0.052272, 0.247190, 0.385537, 5.367655, 0.092809, 0.010591
    x = np.asarray(linear, np.float64)
    log = c * np.log10(a * np.maximum(x, cut) + b) + d
    return np.where(x > cut, log, e * x + f)


def log_codes(rgb: Sequence[Half | Float32], primaries: str, curve: LogCurve) -> Planes:
    """Linear planes as nonlinear R', G', B' in the curve's primaries; white is about 0.55.

    The curve is looked up by the bits of a half float, 20 times finer than a 10-bit step.
    """
    planes = [np.asarray(plane, np.float32) for plane in rgb]
    table, out = _table(curve), []
    for red, green, blue in rgb_to_rgb_matrix(primaries, PRIMARIES[curve]).tolist():
        mixed: Any = cv2.addWeighted(planes[0], red, planes[1], green, 0)
        mixed = cv2.scaleAdd(planes[2], blue, mixed)
        out.append(looked_up(mixed, table).reshape(planes[0].shape))
    return out[0], out[1], out[2]


@functools.lru_cache(maxsize=2)
def _table(curve: LogCurve) -> Float32:
    values = np.nan_to_num(all_halves(), nan=0.0, posinf=65504.0, neginf=-65504.0)
    return np.asarray((acescct if curve == "acescct" else logc3)(values), np.float32)
