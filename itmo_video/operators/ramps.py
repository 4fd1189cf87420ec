"""The smooth ramp from 0 to 1 that `auto` uses throughout, for numbers and for arrays."""

from __future__ import annotations

import numpy as np

from itmo_video.kernels import compiled_auto
from itmo_video.kernels.dispatch import with_compiled_form
from itmo_video.model import Float32


def ramp(value: float, low: float, high: float) -> float:
    """0 up to `low`, 1 from `high` on, 3t² - 2t³ in between."""
    t = min(max((value - low) / (high - low), 0.0), 1.0)
    return t * t * (3 - 2 * t)


@with_compiled_form(compiled_auto.ramps)
def ramps(values: Float32, low: float, high: float) -> Float32:
    """`ramp` of each value: float32 of the same shape."""
    t = np.clip((values - np.float32(low)) * np.float32(1 / (high - low)), 0, 1)
    return np.asarray(t * t * (np.float32(3) - np.float32(2) * t), np.float32)
