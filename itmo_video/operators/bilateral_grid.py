"""Edge-preserving smoothing of one picture along the edges of another."""

from __future__ import annotations

import math

import numpy as np

from itmo_video.model import Float32, Float64

_CELLS = 2.0  # grid cells per sigma


def cross_bilateral(
    values: Float32, guide: Float32, sigma_px: float, sigma_range: float
) -> Float32:
    """Cross-bilateral filter by a bilateral grid; float32 (H, W), within the range of `values`.

    Weights fall as Gaussians of distance (`sigma_px` > 0) and of difference in `guide`, float32
    (H, W) in [0, 1] (`sigma_range` > 0). After Chen, Paris and Durand 2007: splatted to the nearest
    cell, blurred, read trilinearly.
    """
    from scipy import ndimage  # importing it takes an eighth of a second

    height, width = values.shape
    step, level = max(1.0, sigma_px / _CELLS), sigma_range / _CELLS
    y = np.arange(height)[:, np.newaxis] / step
    x = np.arange(width)[np.newaxis, :] / step
    z = np.clip(guide, 0, 1) / level
    cells = (int(y.max()) + 2, int(x.max()) + 2, int(1 / level) + 2)
    nearest = (np.rint(y).astype(np.intp) * cells[1] + np.rint(x).astype(np.intp)) * cells[2]
    at = (nearest + np.rint(z).astype(np.intp)).ravel()
    sigma = (sigma_px / step, sigma_px / step, _CELLS)
    where = np.stack([np.broadcast_to(part, values.shape) for part in (y, x, z)])

    def smoothed(weights: Float32) -> Float64:
        grid = np.bincount(at, weights.ravel(), minlength=math.prod(cells)).reshape(cells)
        grid = ndimage.gaussian_filter(grid, sigma, mode="constant")
        return np.asarray(ndimage.map_coordinates(grid, where, order=1, mode="nearest"))

    smooth = smoothed(values) / np.maximum(smoothed(np.ones_like(values)), 1e-12)
    return np.asarray(np.clip(smooth, values.min(), values.max()), np.float32)
