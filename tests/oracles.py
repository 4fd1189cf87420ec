"""Plain forms that several tests hold the product against."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from itmo_video.colour.linear_light import Planes, to_rgb_linear
from itmo_video.colour.primaries import luminance_weights
from itmo_video.colour.transfer import hlg_gamma
from itmo_video.model import Frame

Float64 = npt.NDArray[np.float64]
# ITU-R BT.2100-2, table 5
_HLG_A, _HLG_B, _HLG_C = 0.17883277, 0.28466892, 0.55991073


def to_rgb_code(frame: Frame) -> Planes:
    """Nonlinear R'G'B', nominally 0 to 1: as the product has it for codes that are light."""
    coded = replace(frame, encoding=replace(frame.encoding, transfer="linear"))
    return to_rgb_linear(coded, clip=False)


def hlg_nits(rgb_code: Float64, peak_nits: float) -> Float64:
    """Light in nits of HLG R'G'B' (3, ...): inverse OETF, then OOTF of a display with this peak."""
    x = np.clip(np.asarray(rgb_code, np.float64), 0, 1)
    scene = np.where(x <= 0.5, x * x / 3, (np.exp((x - _HLG_C) / _HLG_A) + _HLG_B) / 12)
    weights = np.array(luminance_weights("rec2020"))
    y = np.tensordot(weights, scene, 1)
    return np.asarray(
        peak_nits * scene * np.maximum(y, 1e-12) ** (hlg_gamma(peak_nits) - 1), np.float64
    )
