"""The EETF of ITU-R BT.2390: tone mapping from one peak to a display with a lower one."""

from __future__ import annotations

import functools
from typing import Any

import cv2
import numpy as np

from itmo_video.colour import transfer
from itmo_video.delivery.half_tables import all_halves, looked_up, shaped
from itmo_video.delivery.ycbcr import Planes
from itmo_video.model import Float32, Float64


def bt2390_eetf(nits: Float64 | Float32, source_peak: float, display_peak: float) -> Float64:
    """Light on a display of `display_peak` nits for light of up to `source_peak`, black at 0.

    A knee in PQ with a Hermite spline above it, unchanged below. BT.2390-10, 5.4.1, steps 1 to 3
    and 5. Any shape, monotonic; the identity if the display's peak is not lower.
    """
    top, target = (float(transfer.pq_code(np.array(n))) for n in (source_peak, display_peak))
    if target >= top:
        return np.asarray(nits, np.float64)
    e1 = transfer.pq_code(nits) / top
    largest = target / top
    knee = 1.5 * largest - 0.5
    t = np.clip((e1 - knee) / (1 - knee), 0, 1)
    spline = (
        (2 * t**3 - 3 * t**2 + 1) * knee
        + (t**3 - 2 * t**2 + t) * (1 - knee)
        + (-2 * t**3 + 3 * t**2) * largest
    )
    return transfer.pq_nits(np.where(e1 < knee, e1, spline) * top)


def to_display(nits: Planes, source_peak: float, display_peak: float | None) -> Planes:
    """R, G and B in nits with the EETF on max(R, G, B), which keeps hue; None changes nothing."""
    if display_peak is None or display_peak >= source_peak:
        return nits
    return times_factors(nits, display_factors(source_peak, display_peak), display_peak)


def times_factors(nits: Planes, factors: Float32, display_peak: float) -> Planes:
    """Nits times the factor of max(R, G, B), by its bits as a half float, up to the peak."""
    largest = cv2.max(cv2.max(nits[0], nits[1]), nits[2])
    factor = looked_up(largest, factors)
    red, green, blue = (_shown(plane, factor, display_peak) for plane in nits)
    return red, green, blue


def _shown(plane: Float32, factor: Any, display_peak: float) -> Float32:
    # The factor is looked up by half float, so the peak may be exceeded by half a step.
    scaled = cv2.min(cv2.multiply(plane, factor.reshape(plane.shape)), display_peak)
    return shaped(scaled, plane.shape)


@functools.lru_cache(maxsize=4)
def display_factors(source_peak: float, display_peak: float) -> Float32:
    """Output over input nits for all bit patterns of a half float."""
    nits = np.maximum(np.nan_to_num(np.abs(all_halves()), nan=0.0, posinf=65504.0), 1e-6)
    mapped = bt2390_eetf(np.minimum(nits, source_peak), source_peak, display_peak)
    return np.asarray(mapped / nits, np.float32)
