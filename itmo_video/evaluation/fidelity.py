"""How close a picture's luminance is to the true one: pure functions of absolute luminance.

Luminance is in cd/m2, arrays (H, W) unless stated otherwise, computed in float64. Both sides should
go through `displayed` first, so that neither is judged by what no display can show.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from itmo_video.colour.primaries import LUMINANCE_WEIGHTS_BT709
from itmo_video.colour.transfer import pq_code
from itmo_video.model import Float64

Floats: TypeAlias = npt.NDArray[np.floating[Any]]

DARKEST_NITS = 0.005  # PU21 starts here, and so does the display
PU21_PEAK = 256.0  # PU21's code of 100 cd/m2, the peak of its PSNR and SSIM (Mantiuk and Azimi)
VISIBLE = 0.01  # of PQ code: about a tenth of the luminance at 100 cd/m2, 7 steps of Delta E ITP
OBVIOUS = 0.04
ZONE_EDGES = (-6.0, -4.0, -2.0, 0.0, 1.0, 2.0)  # stops relative to SDR white
PERCENTILES = (1.0, 10.0, 50.0, 90.0, 99.0, 99.9, 100.0)

_PU21 = (  # banding_glare, table 1 of the publication
    0.353487901, 0.3734658629, 8.277049286e-05, 0.9062562627,
    0.09150303166, 0.9099517204, 596.3148142,
)  # fmt: skip


@dataclass(frozen=True)
class Zone:
    """Error where the true luminance is in [lower, upper) stops relative to SDR white.

    `mean` (signed) and `mean_abs` are in stops, NaN if the zone is empty; `share` is of the pixels.
    """

    lower: float
    upper: float
    share: float
    mean: float
    mean_abs: float


@dataclass(frozen=True)
class Fidelity:
    """All figures of one picture compared with its truth, as the functions define them."""

    pq_psnr_db: float
    pu21_psnr_db: float
    pu21_ssim: float
    visible_share: float
    obvious_share: float
    zones: tuple[Zone, ...]
    percentiles: dict[float, float]


def displayed(rgb: Floats, white_nits: float = 203.0, peak_nits: float = 1000.0) -> Float64:
    """The luminance that a display shows for linear BT.709 RGB (..., 3) with 1.0 at `white_nits`.

    Float64 (...) in cd/m2, each channel clipped to the display's range. ValueError for NaN.
    """
    light = np.asarray(rgb, np.float64) * white_nits
    if np.isnan(light).any():
        raise ValueError("the picture has pixels that are not numbers (NaN)")
    shown = np.clip(light, DARKEST_NITS, peak_nits)
    return np.asarray(shown @ np.array(LUMINANCE_WEIGHTS_BT709))


def pu21_encode(nits: Floats) -> Float64:
    """PU21 code, banding and glare, of luminance clipped to 0.005 to 10000 cd/m2; any shape.

    P = p7 * (((p1 + p2 Y^p4) / (1 + p3 Y^p4))^p5 - p6), eq. 1 of Mantiuk and Azimi, PU21, PCS 2021;
    about 0 at 0.005 cd/m2, 256 at 100 and 595 at 10000.
    """
    a, b, c, d, e, f, g = _PU21
    power = np.clip(np.asarray(nits, np.float64), DARKEST_NITS, 10000.0) ** d
    return np.asarray(g * (((a + b * power) / (1 + c * power)) ** e - f))


def psnr_db(test: Floats, reference: Floats, peak: float) -> float:
    """10 log10(peak^2 / mean squared difference); infinite if they are identical."""
    _check(test, reference)
    error = float(np.mean((np.asarray(test, np.float64) - reference) ** 2))
    return math.inf if error == 0 else 10 * math.log10(peak * peak / error)


def pq_psnr_db(test_nits: Floats, reference_nits: Floats) -> float:
    """PSNR of PQ codes of luminance, peak 1."""
    return psnr_db(pq_code(test_nits), pq_code(reference_nits), 1.0)


def pu21_psnr_db(test_nits: Floats, reference_nits: Floats) -> float:
    """PSNR of PU21 codes of luminance, with a peak of 256 as its authors use."""
    return psnr_db(pu21_encode(test_nits), pu21_encode(reference_nits), PU21_PEAK)


def pu21_ssim(test_nits: Floats, reference_nits: Floats) -> float:
    """Mean SSIM of PU21 codes, dynamic range 256, in [-1, 1]; 1 if they are identical.

    Wang et al. 2004, eq. 13: Gaussian window of 11 pixels and sigma 1.5, K1 0.01, K2 0.03; edges
    replicated, as in the authors' reference code.
    """
    _check(test_nits, reference_nits)
    x, y = pu21_encode(test_nits), pu21_encode(reference_nits)
    c1, c2 = (0.01 * PU21_PEAK) ** 2, (0.03 * PU21_PEAK) ** 2
    mean_x, mean_y = _window(x), _window(y)
    var_x, var_y = _window(x * x) - mean_x**2, _window(y * y) - mean_y**2
    covariance = _window(x * y) - mean_x * mean_y
    top = (2 * mean_x * mean_y + c1) * (2 * covariance + c2)
    return float(np.mean(top / ((mean_x**2 + mean_y**2 + c1) * (var_x + var_y + c2))))


def stops(test_nits: Floats, reference_nits: Floats) -> Float64:
    """Log2 of test over reference, both at least 0.005 cd/m2; positive if the test is brighter."""
    _check(test_nits, reference_nits)
    test, reference = np.maximum(test_nits, DARKEST_NITS), np.maximum(reference_nits, DARKEST_NITS)
    return np.asarray(np.log2(test.astype(np.float64) / reference))


def zones(test_nits: Floats, reference_nits: Floats, white_nits: float = 203.0) -> tuple[Zone, ...]:
    """Error in stops by zone of true luminance, between ZONE_EDGES."""
    error = stops(test_nits, reference_nits)
    height = np.log2(np.maximum(reference_nits, DARKEST_NITS) / white_nits)
    bounds = (-math.inf, *ZONE_EDGES, math.inf)
    found = []
    for lower, upper in pairwise(bounds):
        inside = error[(height >= lower) & (height < upper)]
        mean, mean_abs = math.nan, math.nan
        if inside.size:
            mean, mean_abs = float(inside.mean()), float(np.abs(inside).mean())
        found.append(Zone(lower, upper, inside.size / error.size, mean, mean_abs))
    return tuple(found)


def percentile_stops(
    test_nits: Floats, reference_nits: Floats, percentiles: Sequence[float] = PERCENTILES
) -> dict[float, float]:
    """Log2 of the test's over the reference's luminance by percentile; 100 is the peak."""
    _check(test_nits, reference_nits)
    values = stops(
        np.percentile(test_nits, percentiles), np.percentile(reference_nits, percentiles)
    )
    return dict(zip(percentiles, values.tolist(), strict=True))


def visible_share(test_nits: Floats, reference_nits: Floats, threshold: float = VISIBLE) -> float:
    """Share of pixels, 0 to 1, whose PQ codes of luminance differ by more than `threshold`.

    Our own measure, pixel by pixel: unlike HDR-VDP it models neither masking nor size.
    """
    _check(test_nits, reference_nits)
    return float(np.mean(np.abs(pq_code(test_nits) - pq_code(reference_nits)) > threshold))


def compare(test_nits: Floats, reference_nits: Floats, white_nits: float = 203.0) -> Fidelity:
    """All of the above for one picture; ValueError if shapes differ."""
    return Fidelity(
        pq_psnr_db(test_nits, reference_nits),
        pu21_psnr_db(test_nits, reference_nits),
        pu21_ssim(test_nits, reference_nits),
        visible_share(test_nits, reference_nits),
        visible_share(test_nits, reference_nits, OBVIOUS),
        zones(test_nits, reference_nits, white_nits),
        percentile_stops(test_nits, reference_nits),
    )


def _window(values: Float64) -> Float64:
    return np.asarray(cv2.GaussianBlur(values, (11, 11), 1.5, borderType=cv2.BORDER_REPLICATE))


def _check(test: Floats, reference: Floats) -> None:
    if test.shape != reference.shape:
        raise ValueError(f"pictures differ in size: {test.shape} and {reference.shape}")
