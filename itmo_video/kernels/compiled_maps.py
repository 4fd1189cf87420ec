"""The compiled form of sums of maps, weighted by one number per pixel for all channels."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Sequence

import numpy as np

from itmo_video.kernels.compiled import Float32, alike, whole


def mean_of_maps(
    loaded: ctypes.CDLL, own: Float32, others: Sequence[Float32], weights: Sequence[Float32]
) -> Float32:
    """The mean of maps (H, W) or (H, W, C), weighted by (H, W), and of `own` by 1: a new array."""
    own, others, weights = whole(own), [whole(o) for o in others], [whole(w) for w in weights]
    for weight, other in zip(weights, others, strict=True):
        _channels(weight, own, other)  # which checks shapes
    count = math.prod(own.shape[:2])
    out = np.empty_like(own)
    loaded.itmo_mean_of_maps(
        own, *(np.array([a.ctypes.data for a in arrays], np.int64) for arrays in (others, weights)),
        len(others), count, own.size // max(count, 1),
        out,
    )  # fmt: skip
    return out


def blend(loaded: ctypes.CDLL, left: Float32, right: Float32, share: Float32) -> Float32:
    """`left` + (`right` - `left`) times `share`: maps (H, W) or (H, W, C), and (H, W)."""
    left, right, share = whole(left), whole(right), whole(share)
    out = np.empty_like(left)
    loaded.itmo_blend(
        left, right, share, share.size, _channels(share, left, right),
        out,
    )  # fmt: skip
    return out


def _channels(weight: Float32, *maps: Float32) -> int:
    """The number of channels per weight; ValueError if shapes do not match."""
    alike(*maps)
    if maps[0].shape[: weight.ndim] != weight.shape:
        raise ValueError(f"a weight {weight.shape} for maps {maps[0].shape}")
    return maps[0].size // max(weight.size, 1)
