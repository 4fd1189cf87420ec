"""Flicker: changes of map and gain along motion, drift, and amplified noise.

Pure functions of arrays. A flow belongs to the later frame: `flow_px[y, x]` is where its pixel
(x, y) was in the earlier one, relative to (x, y).
"""

from __future__ import annotations

import math

import cv2
import numpy as np
import numpy.typing as npt

from itmo_video.model import Code, Float32
from itmo_video.motion.flow import flow_px, warp

Mask = npt.NDArray[np.bool_]

CONSISTENT_PX = 1.0  # forward and backward flow must meet this closely
DARK = 1e-3  # of SDR white: below it, a gain is noise
HIGHLIGHT = 0.5  # of SDR white
FLAT = 0.03  # relative deviation within a window up to which a highlight counts as flat
CLIPPED = 0.98  # of a channel: compression lets clipped areas waver
LEAST_GRAIN = 1e-3  # stops
WINDOW_PX = 9


def known_flow(shape_hw: tuple[int, int], dx_px: float, dy_px: float) -> tuple[Float32, Mask]:
    """The flow of a window whose origin moved by (dx, dy), and where it is valid.

    Pixel (u, v) of the later frame was at (u + dx, v + dy) in the earlier one.
    """
    height, width = shape_hw
    flow = np.empty((height, width, 2), np.float32)
    flow[..., 0], flow[..., 1] = dx_px, dy_px
    return flow, _inside(flow)


def estimated_flow(here: Code, before: Code) -> tuple[Float32, Mask]:
    """The flow from the later picture `here` to `before` (8-bit grey), and where it is valid."""
    flow, back = flow_px(here, before), flow_px(before, here)
    returned = cv2.remap(back, _grid(flow.shape[:2]) + flow, None, cv2.INTER_LINEAR)
    error = np.hypot(flow[..., 0] + returned[..., 0], flow[..., 1] + returned[..., 1])
    return flow, _inside(flow) & (error < CONSISTENT_PX)


def change_along(before: Float32, after: Float32, flow: Float32, valid: Mask) -> float:
    """Mean absolute change of a quantity along the flow, where valid; NaN if valid nowhere."""
    if not valid.any():
        return math.nan
    difference = np.abs(after - warp(before, flow))
    return float(difference[valid].mean(dtype=np.float64))


def log_gain(hdr: Float32, sdr: Float32) -> Float32:
    """Gain in stops of linear luminance, both in units of SDR white; 0 where SDR is too dark."""
    gain = np.log2(np.maximum(hdr, 1e-6) / np.maximum(sdr, 1e-6))
    return np.where(sdr > DARK, gain, 0).astype(np.float32)


def background_level(gain_stops: Float32, sdr: Float32) -> float:
    """Mean gain in stops of the darker half of the picture."""
    return float(gain_stops[sdr <= np.median(sdr)].mean(dtype=np.float64))


def noise_gain(hdr: Float32, sdr: Float32, greatest: Float32) -> float:
    """Grain of log2 luminance in flat highlights, after over before; NaN if there are none.

    The median over windows that are flat before. Windows in which a pixel's `greatest` channel
    (linear SDR) clips do not count, because its grain is cut off. Grain is the difference from
    adjacent pixels, so that a smooth rise of the gain does not count.
    """
    before, after = (np.log2(np.maximum(x, 1e-6)).astype(np.float64) for x in (sdr, hdr))
    deviation_before = _deviation(before)
    grain_before, grain_after = (_deviation(x - cv2.blur(x, (3, 3))) for x in (before, after))
    mean = cv2.blur(sdr, (WINDOW_PX, WINDOW_PX))
    limit = FLAT / math.log(2)
    most = cv2.dilate(greatest, np.ones((WINDOW_PX, WINDOW_PX)))
    flat = (mean > HIGHLIGHT) & (most < CLIPPED) & (deviation_before < limit)
    flat &= grain_before > LEAST_GRAIN
    flat[: WINDOW_PX // 2] = flat[-(WINDOW_PX // 2) :] = False
    flat[:, : WINDOW_PX // 2] = flat[:, -(WINDOW_PX // 2) :] = False
    if flat.sum() < WINDOW_PX**2:
        return math.nan
    return float(np.median(grain_after[flat] / grain_before[flat]))


def _deviation(values: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    size = (WINDOW_PX, WINDOW_PX)
    mean = cv2.blur(values, size)
    square = cv2.blur(values * values, size)
    return np.asarray(np.sqrt(np.maximum(square - mean * mean, 0)))


def _grid(shape_hw: tuple[int, ...]) -> Float32:
    x, y = np.meshgrid(np.arange(shape_hw[1]), np.arange(shape_hw[0]))
    return np.dstack([x, y]).astype(np.float32)


def _inside(flow: Float32) -> Mask:
    height, width = flow.shape[:2]
    at = _grid((height, width)) + flow
    x, y = at[..., 0], at[..., 1]
    return np.asarray((x >= 0) & (x <= width - 1) & (y >= 0) & (y <= height - 1))
