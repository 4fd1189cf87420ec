"""Upsamples chroma to the luma's size.

Linear interpolation between sample positions; at the edges the last sample is repeated.
"""

from __future__ import annotations

import cv2
import numpy as np

from itmo_video.model import ChromaSiting, Code, Float32, Float64


def upsample_chroma(plane: Code, size: tuple[int, int], siting: ChromaSiting) -> Float64:
    """Upsample a plane to (width, height) by linear interpolation, in code units.

    For any integer factor, simple but slow; float64, exact for 8 to 16-bit codes. `double_rows`
    and `double_columns` are fast versions for factors of 2.
    """
    width, height = size
    rows = _interpolate(plane.astype(np.float64), height, siting_offset(siting, vertical=True))
    return _interpolate(rows.T, width, siting_offset(siting, vertical=False)).T


def siting_offset(siting: ChromaSiting, *, vertical: bool) -> float:
    """The position of a chroma sample among its pixels: 0 first, 0.5 midway, 1 last."""
    first, last = ("top", "bottom") if vertical else ("left", "right")
    return 0.0 if first in siting else 1.0 if last in siting else 0.5


def double_rows(values: Float32, offset: float) -> Float32:
    """Double the inner rows: (n + 2, w), with a neighbour row at each end, to (2 n, w)."""
    count, across = values.shape[0] - 2, values.shape[1]
    out = np.empty((count, 2, across), np.float32)
    here, before, after = values[1:-1], values[:-2], values[2:]
    if offset == 0.5:  # even rows also use the sample above, odd rows the one below
        cv2.addWeighted(here, 0.75, before, 0.25, 0, dst=out[:, 0])
        cv2.addWeighted(here, 0.75, after, 0.25, 0, dst=out[:, 1])
    elif offset == 0:
        np.copyto(out[:, 0], here)
        cv2.addWeighted(here, 0.5, after, 0.5, 0, dst=out[:, 1])
    else:
        cv2.addWeighted(here, 0.5, before, 0.5, 0, dst=out[:, 0])
        np.copyto(out[:, 1], here)
    return out.reshape(2 * count, across)


def double_columns(values: Float32, offset: float) -> Float32:
    """Double the columns: (n, w) to (n, 2 w), interleaved by cv2.merge, which only copies."""
    rows, across = values.shape
    around = cv2.copyMakeBorder(values, 0, 0, 1, 1, cv2.BORDER_REPLICATE)
    before, after = around[:, :-2], around[:, 2:]
    if offset == 0.5:
        even = cv2.addWeighted(values, 0.75, before, 0.25, 0)
        odd = cv2.addWeighted(values, 0.75, after, 0.25, 0)
    elif offset == 0:
        even, odd = values, cv2.addWeighted(values, 0.5, after, 0.5, 0)
    else:
        even, odd = cv2.addWeighted(values, 0.5, before, 0.5, 0), values
    return np.asarray(cv2.merge((even, odd)), np.float32).reshape(rows, 2 * across)


def _interpolate(values: Float64, count: int, offset: float) -> Float64:
    """Rows at `count` integer positions, linear between samples, constant outside."""
    factor = 1
    while values.shape[0] * factor < count:
        factor *= 2
    at = np.clip((np.arange(count) - offset * (factor - 1)) / factor, 0, values.shape[0] - 1)
    below = np.floor(at).astype(np.intp)
    above = np.minimum(below + 1, values.shape[0] - 1)
    part = (at - below)[:, None]
    return np.asarray(values[below] * (1 - part) + values[above] * part, np.float64)
