"""The compiled form of sums of maps, weighted by one number per pixel for all channels."""

from __future__ import annotations

import ctypes

import numpy as np

from itmo_video.kernels.compiled import Float32, alike, whole


def add_weighed(loaded: ctypes.CDLL, total: Float32, values: Float32, weight: Float32) -> None:
    """`total` += `values` times `weight`: maps (H, W) or (H, W, C), in place, and (H, W)."""
    values, weight = whole(values), whole(weight)
    loaded.itmo_add_weighed(
        values, weight, weight.size, _channels(weight, total, values),
        total,
    )  # fmt: skip


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
