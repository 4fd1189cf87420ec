"""A frame's luminance by the paper's equation 1, strip by strip, and its RGB at analysis size."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import cv2
import numpy as np

from itmo_video import linear_light, native
from itmo_video.guide import averaged
from itmo_video.model import Float32, Frame
from itmo_video.operators import LUMINANCE_WEIGHTS

# With fewer, threads wait for each other's GIL; with more, planes leave the cache.
STRIP_ROWS = 120


def strips(height: int) -> Iterator[slice]:
    """Rows of a frame, STRIP_ROWS at a time."""
    for top in range(0, height, STRIP_ROWS):
        yield slice(top, min(top + STRIP_ROWS, height))


def luminance_of(rgb: Sequence[Float32], out: Float32 | None = None) -> Float32:
    """Eq. 1, of the source's own RGB: float32 of the planes' shape."""
    r, g, b = LUMINANCE_WEIGHTS
    total = np.multiply(rgb[0], np.float32(r), out=out)
    total += rgb[1] * np.float32(g)
    total += rgb[2] * np.float32(b)
    return total


def limited_luminance(
    rgb: Sequence[Float32], ratio: Float32 | None = None, out: Float32 | None = None
) -> Float32:
    """Eq. 1 times `ratio`, if any, limited to [0, 1]: float32 of the planes' shape."""
    if (loaded := native.library()) is not None:
        return native.drive(loaded, rgb, LUMINANCE_WEIGHTS, ratio, out)
    luminance = luminance_of(rgb, out)
    if ratio is not None:
        luminance *= ratio
    return np.clip(luminance, 0, 1, out=luminance)


def frame_luminance(frame: Frame) -> Float32:
    """Linear luminance of a whole frame, (H, W) float32 in [0, 1]."""
    width, height = frame.size
    luminance = np.empty((height, width), np.float32)
    for rows in strips(height):
        rgb = strip_buffers(rows, width)
        linear_light.strip_to_rgb_linear(frame, rows, True, rgb)
        limited_luminance(rgb, out=luminance[rows])
    return luminance


def frame_rgb_small(frame: Frame, size: tuple[int, int]) -> Float32:
    """Linear RGB of a frame, area-averaged to (width, height): float32 (H, W, 3) in [0, 1]."""
    width, height = frame.size
    halves = width % 2 == 0 and height % 2 == 0 and width >= 2 * size[0] and height >= 2 * size[1]
    step = 2 if halves else 1  # while it is in the cache: cv2 gives the same bytes by strips
    planes = [np.empty((height // step, width // step), np.float32) for _ in range(3)]
    for rows in strips(height):
        rgb = strip_buffers(rows, width)
        linear_light.strip_to_rgb_linear(frame, rows, True, rgb)
        inner = slice(rows.start // step, rows.stop // step)
        for plane, strip in zip(planes, rgb, strict=True):
            if halves:
                half = (width // 2, inner.stop - inner.start)
                cv2.resize(strip, half, dst=plane[inner], interpolation=cv2.INTER_AREA)
            else:
                plane[inner] = strip
    if size != planes[0].shape[::-1]:
        planes = [averaged(plane, size) for plane in planes]
    small = np.stack(planes, axis=-1)
    return np.clip(small, 0, 1, out=small)


def strip_buffers(rows: slice, width: int) -> tuple[Float32, Float32, Float32]:
    """Room for R, G and B of some rows of a frame: three float32 arrays of (rows, width)."""
    shape = (rows.stop - rows.start, width)
    return np.empty(shape, np.float32), np.empty(shape, np.float32), np.empty(shape, np.float32)
