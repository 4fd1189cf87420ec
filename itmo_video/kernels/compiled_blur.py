"""The compiled form of planes smoothed by a Gaussian."""

from __future__ import annotations

import ctypes

import numpy as np

from itmo_video.kernels.compiled import Float32, whole

_AT_A_TIME, _LINE = 32, 16  # as in blur.c


def blurred(loaded: ctypes.CDLL, planes: Float32, weights: Float32) -> Float32:
    """Planes (H, W) or (H, W, C), each smoothed both ways, mirrored at its edges: a new array.

    `weights` are the middle's and those to one side of it.
    """
    if planes.ndim not in (2, 3) or not weights.size:
        raise ValueError(f"planes of shape {planes.shape}, {weights.size} weights")
    planes, half = whole(planes), len(weights) - 1
    height, width = planes.shape[:2]
    channels = planes.shape[2] if planes.ndim == 3 else 1
    step = (width * channels // _AT_A_TIME + 1) * _AT_A_TIME + _LINE
    out = np.empty_like(planes)
    if out.size:
        loaded.itmo_blurred(
            planes, height, width, channels, half, whole(weights),
            np.empty(2 * half * channels + (2 * half + 2) * step, np.float32), out,
        )  # fmt: skip
    return out
