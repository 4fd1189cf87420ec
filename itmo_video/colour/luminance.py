"""A frame's luminance by eq. 1 of the paper, strip by strip, and its RGB at analysis size."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence

import cv2
import numpy as np

from itmo_video.colour import linear_light
from itmo_video.colour.analysis_picture import averaged
from itmo_video.colour.primaries import LUMINANCE_WEIGHTS_BANTERLE2006
from itmo_video.colour.strips import strip_buffers, strips
from itmo_video.kernels import compiled, compiled_near_white
from itmo_video.kernels.dispatch import with_compiled_form
from itmo_video.model import Float32, Frame


def luminance_of(rgb: Sequence[Float32], out: Float32 | None = None) -> Float32:
    """Luminance by eq. 1, of RGB in the source's primaries: float32 of the planes' shape."""
    r, g, b = LUMINANCE_WEIGHTS_BANTERLE2006
    total = np.multiply(rgb[0], np.float32(r), out=out)
    total += rgb[1] * np.float32(g)
    total += rgb[2] * np.float32(b)
    return total


def _compiled_luminance(
    loaded: ctypes.CDLL,
    rgb: Sequence[Float32],
    ratio: Float32 | None = None,
    out: Float32 | None = None,
) -> Float32:
    return compiled.weighted_sum(loaded, rgb, LUMINANCE_WEIGHTS_BANTERLE2006, ratio, out)


@with_compiled_form(_compiled_luminance)
def limited_luminance(
    rgb: Sequence[Float32], ratio: Float32 | None = None, out: Float32 | None = None
) -> Float32:
    """Luminance by eq. 1, times `ratio` if any, clipped to [0, 1]: float32 of the planes' shape."""
    luminance = luminance_of(rgb, out)
    if ratio is not None:
        luminance *= ratio
    return np.clip(luminance, 0, 1, out=luminance)


def frame_luminance(frame: Frame) -> Float32:
    """The linear luminance of a whole frame, (H, W) float32 in [0, 1]."""
    width, height = frame.size
    luminance = np.empty((height, width), np.float32)
    for rows in strips(height):
        rgb = strip_buffers(rows, width)
        linear_light.strip_to_rgb_linear(frame, rows, True, rgb)
        limited_luminance(rgb, out=luminance[rows])
    return luminance


@with_compiled_form(compiled_near_white.greatest)
def greatest_of(rgb: Float32) -> Float32:
    """The highest channel of each pixel of (H, W, 3): float32 (H, W)."""
    red, green, blue = cv2.split(rgb)  # NumPy's max along an axis of three takes ten times as long
    return np.asarray(cv2.max(cv2.max(red, green), blue), np.float32).reshape(rgb.shape[:2])


@with_compiled_form(compiled_near_white.luminance)
def luminance_of_pixels(rgb: Float32) -> Float32:
    """`luminance_of` of (H, W, 3): float32 (H, W)."""
    return luminance_of(cv2.split(rgb)).reshape(rgb.shape[:2])


def frame_rgb_small(frame: Frame, size: tuple[int, int]) -> Float32:
    """Linear RGB of a frame, area-averaged to (width, height): float32 (H, W, 3) in [0, 1]."""
    width, height = frame.size
    if width % 2 == 0 and height % 2 == 0 and width >= 2 * size[0] and height >= 2 * size[1]:
        planes = linear_light.halved_rgb_linear(frame)
    else:
        planes = linear_light.to_rgb_linear(frame, clip=True)
    small = planes if size == planes[0].shape[::-1] else [averaged(p, size) for p in planes]
    rgb = np.asarray(cv2.merge(small), np.float32).reshape(size[1], size[0], 3)
    return np.clip(rgb, 0, 1, out=rgb)
