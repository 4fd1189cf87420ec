"""The compiled form of averages over areas."""

from __future__ import annotations

import ctypes
import functools
import math
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from itmo_video.kernels.compiled import Float32, in_lines

Plane = TypeVar("Plane", bound=npt.NDArray[Any])


def area_means(loaded: ctypes.CDLL, planes: Plane, size: tuple[int, int]) -> Plane:
    """Planes (H, W) or (H, W, C) of uint8, uint16 or float32, averaged to (width, height).

    A new array, with the bytes of cv2.resize by INTER_AREA, for a size that is not larger, and not
    both sides by whole factors.
    """
    (height, width), (out_width, out_height) = planes.shape[:2], size
    channels = planes.shape[2] if planes.ndim == 3 else 1
    if not (0 < out_width <= width and 0 < out_height <= height and channels):
        raise ValueError(f"{width}x{height} averaged to {out_width}x{out_height}")
    whole = np.ascontiguousarray(planes) if planes.ndim == 3 else planes
    lines = in_lines(whole.reshape(height, width * channels))
    columns, column_shares = _areas(width, out_width)
    rows, row_shares = _areas(height, out_height)
    taps, down = len(column_shares), len(row_shares)
    out = np.empty((*size[::-1], *planes.shape[2:]), planes.dtype)
    loaded.itmo_area_means(
        lines, lines.strides[0], lines.itemsize,
        np.array([width, out_width, out_height, taps, down, channels], np.int64),
        columns, column_shares, rows, row_shares,
        np.empty((width + 2 * out_width) * channels, np.float32), out.view(np.uint8),
    )  # fmt: skip
    return out  # type: ignore[return-value]  # of planes.dtype


@functools.lru_cache(maxsize=16)
def _areas(size: int, out_size: int) -> tuple[npt.NDArray[np.int32], Float32]:
    """Where each area begins, and the shares of the places in it: (taps, areas).

    As OpenCV's computeResizeAreaTab (resize.cpp), which leaves out shares below 0.001 of a place.
    """
    scale = size / out_size
    starts, shares = [], []
    for area in range(out_size):
        begin, end = area * scale, (area + 1) * scale
        length = min(scale, size - begin)
        last = min(math.floor(end), size - 1)
        first = min(math.ceil(begin), last)
        parts = [1.0 / length] * (last - first)
        starts.append(first)
        if first - begin > 1e-3:
            starts[-1] = first - 1
            parts.insert(0, (first - begin) / length)
        if end - last > 1e-3:
            parts.append(min(end - last, 1.0, length) / length)
        shares.append(parts)
    taps = max(map(len, shares))
    table = np.zeros((taps, out_size), np.float32)
    for area, parts in enumerate(shares):
        before = max(0, starts[area] + taps - size)  # places of no weight, to stay in the plane
        starts[area] -= before
        table[before : before + len(parts), area] = parts
    return np.array(starts, np.int32), table
