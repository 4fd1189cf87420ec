"""Upsamples maps from analysis size to the picture's: by rows, and along its edges."""

from __future__ import annotations

import functools
from typing import Any, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from itmo_video.kernels import compiled
from itmo_video.kernels.dispatch import with_compiled_form
from itmo_video.model import Float32

Floats: TypeAlias = npt.NDArray[np.floating[Any]]
Indices: TypeAlias = npt.NDArray[np.int64]


def upsample_rows(
    maps_small: Float32, rows: slice, shape_hw: tuple[int, int], wrap_x: bool = False
) -> Float32:
    """Some rows of maps (..., h, w) upsampled to (H, W), bilinearly, areas aligned.

    A new float32 array (..., rows, W), within 1e-6 of cv2.resize. Any strip gives the same rows to
    the bit, unlike cv2.resize of parts. `wrap_x` for panoramas, whose last column is adjacent to
    the first.
    """
    height, width = shape_hw
    above, below, part, rest = rows_between(rows.start, rows.stop, maps_small.shape[-2], height)
    # With take, as indexing by rows or columns gives a transposed layout in memory.
    strip = maps_small.take(above, -2) * rest[:, None]
    strip += maps_small.take(below, -2) * part[:, None]
    small_w = strip.shape[-1]
    if small_w == width:
        return np.asarray(strip, np.float32)
    if wrap_x:
        x = (np.arange(width) + 0.5) * (small_w / width) - 0.5
        left = np.floor(x).astype(np.intp)
        share = (x - left).astype(np.float32)
        here, right = strip.take(left % small_w, -1), strip.take((left + 1) % small_w, -1)
        return np.asarray(here * (1 - share) + right * share, np.float32)
    lines = strip.reshape(-1, small_w)
    wide = cv2.resize(lines, (width, lines.shape[0]), interpolation=cv2.INTER_LINEAR)
    return np.asarray(wide, np.float32).reshape(*strip.shape[:-1], width)


@functools.lru_cache(maxsize=256)  # the strips of a frame of 8K
def rows_between(
    start: int, stop: int, small_height: int, height: int
) -> tuple[Indices, Indices, Float32, Float32]:
    """The small rows above and below each full row, and the weights of lower and upper."""
    y = (np.arange(start, stop) + 0.5) * (small_height / height) - 0.5
    y = np.clip(y, 0, small_height - 1)
    above = np.minimum(y.astype(np.int64), max(small_height - 2, 0))
    below = np.minimum(above + 1, small_height - 1)
    part = (y - above).astype(np.float32)
    return above, below, part, np.float32(1) - part


def edge_aware_coefficients(
    map_small: Float32, guide_small: Float32, radius_px: int, epsilon: float
) -> tuple[Float32, Float32]:
    """Coefficients a, b, each float32 (H, W), with map ~ a * guide + b around every pixel.

    The fast guided filter (He and Sun 2015, arXiv:1505.00996; eq. 5-8 of He et al. 2013):
    upsampled, they give the map as a * guide + b, to be clipped to [0, 1], with the edges of the
    full-size guide. `map_small`, `guide_small`: float32 (H, W), the guide in any encoding.
    Windows span 2 * radius_px + 1 pixels and shrink at the picture's edges; `epsilon` > 0 is the
    variance of the guide, in its unit squared, below which it counts as flat. The map may be the
    guide itself: an edge-preserving filter.
    """
    if map_small.shape != guide_small.shape:
        raise ValueError(f"map {map_small.shape} and guide {guide_small.shape} differ in shape")
    if radius_px < 0 or not epsilon > 0.0:
        raise ValueError(f"needs radius_px >= 0 and epsilon > 0, not {radius_px}, {epsilon}")
    share = _window_share(*map_small.shape, radius_px)
    return _guided_coefficients(map_small, guide_small, radius_px, epsilon, share)


@with_compiled_form(compiled.guided_coefficients)
def _guided_coefficients(
    map_small: Float32, guide_small: Float32, radius_px: int, epsilon: float, share: Float32
) -> tuple[Float32, Float32]:
    def mean(image: Floats) -> Float32:
        return np.asarray(_box_sum(image, radius_px) * share, np.float32)

    guide_mean = map_mean = mean(guide_small)
    variance = np.maximum(mean(guide_small * guide_small) - guide_mean * guide_mean, 0.0)
    covariance = variance
    if map_small is not guide_small:
        map_mean = mean(map_small)
        covariance = mean(guide_small * map_small) - guide_mean * map_mean
    a = covariance / (variance + np.float32(epsilon))
    return mean(a), mean(map_mean - a * guide_mean)


def _box_sum(image: Floats, radius_px: int) -> Float32:
    size = (2 * radius_px + 1, 2 * radius_px + 1)
    summed = cv2.boxFilter(image, -1, size, normalize=False, borderType=cv2.BORDER_CONSTANT)
    return np.asarray(summed, dtype=np.float32)


@functools.lru_cache(maxsize=8)
def _window_share(height: int, width: int, radius_px: int) -> Float32:
    """One over the number of pixels of each window inside the picture."""
    return np.asarray(1 / _box_sum(np.ones((height, width), np.float32), radius_px), np.float32)
