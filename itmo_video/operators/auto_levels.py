"""How far clipped places lie above white, per channel, estimated by a fitted network.

Fitted by docs/auto/fit.py to HDR panoramas of known radiance; run at keyframes (auto_network). For
a series of levels above SDR white it predicts the probability that the radiance reaches each level;
the sum up to the peak is the expected log2 of the radiance limited to that peak, so one network
serves every L'max.
"""

from __future__ import annotations

import ctypes
import math
from typing import NamedTuple

import cv2
import numpy as np

from itmo_video.colour.analysis_picture import area_means
from itmo_video.colour.luminance import greatest_of
from itmo_video.kernels import compiled_network
from itmo_video.kernels.dispatch import with_compiled_form
from itmo_video.model import Float32
from itmo_video.operators.auto_network import network_shares

# As in docs/auto/network.py, with which the weights were fitted.
EDGES_STOPS = (0.0, 0.3, 0.6, 0.9, 1.2, 1.6, 2.0, 2.5, 3.1, 3.7, 4.4)
GATE_CENTRE, GATE_SLOPE = 0.9, 40.0
TILE_PX = 32  # the network halves five times, so its pictures are multiples of this
WIDTH_PX = 320  # of the network's picture if it would be wider than 480: takes half the time
WRAP_PX = 64  # added at each side of a panorama from its other side
CERTAIN_STOPS = 2.3  # levels that a display of 1000 nits shows


@with_compiled_form(compiled_network.srgb_codes)
def srgb_codes(rgb_linear: Float32) -> Float32:
    """SRGB codes in [0, 1] of linear light in [0, 1], float32 (IEC 61966-2-1)."""
    curve = cv2.log(np.maximum(rgb_linear, np.float32(0.0031308)))
    curve *= np.float32(1 / 2.4)  # by log and exp, as cv2.pow takes three times as long
    curve = np.float32(1.055) * cv2.exp(curve) - np.float32(0.055)
    low = rgb_linear <= np.float32(0.0031308)
    return np.where(low, np.float32(12.92) * rgb_linear, curve).astype(np.float32)


def _compiled_features(loaded: ctypes.CDLL, codes: Float32, height: int) -> Float32:
    return compiled_network.features(loaded, codes, height, (GATE_CENTRE, GATE_SLOPE))


@with_compiled_form(_compiled_features)
def features(codes: Float32, height: int) -> Float32:
    """The network's input, float32 (17, h/2, w/2), of codes (h, w, 3) in [0, 1].

    The codes and gates of 2 x 2 pixels, and the vertical position from -1 at the top to 1 at row
    `height`; rows beyond it are padding. h and w are even.
    """
    h, w = codes.shape[0] // 2, codes.shape[1] // 2
    greatest = greatest_of(codes)
    gates = 1 / (1 + np.exp(np.float32(-GATE_SLOPE) * (greatest - np.float32(GATE_CENTRE))))
    gates *= np.float32(1 + math.exp(-GATE_SLOPE * (1 - GATE_CENTRE)))
    planes = np.concatenate([(codes - np.float32(0.5)).transpose(2, 0, 1), gates[None]])
    squares = planes.reshape(4, h, 2, w, 2).transpose(0, 2, 4, 1, 3).reshape(16, h, w)
    place = np.float32(-1) + np.arange(h, dtype=np.float32) * np.float32(2 / max(height / 2 - 1, 1))
    row = np.broadcast_to(place[None, :, None], (1, h, w))
    return np.ascontiguousarray(np.concatenate([squares, row]), np.float32)


def level_shares(rgb_linear: Float32, wrap_x: bool = False) -> Float32:
    """The network's prediction, for any L'max: float32 (3, levels, h, w), shares per level.

    `rgb_linear` is the picture at analysis size, float32 (H, W, 3) in [0, 1]; `wrap_x` for a
    panorama. h and w are half of the network's padded picture's.
    """
    height, width = _seen_size(*rgb_linear.shape[:2])
    if (height, width) != rgb_linear.shape[:2]:
        rgb_linear = area_means(rgb_linear, (width, height))
    codes = srgb_codes(rgb_linear)
    if wrap_x:
        codes = np.concatenate(
            [codes.take(range(-WRAP_PX, 0), 1, mode="wrap"), codes,
             codes.take(range(width, width + WRAP_PX), 1, mode="wrap")], axis=1,
        )  # fmt: skip
    below, right = -height % TILE_PX, -codes.shape[1] % TILE_PX
    codes = cv2.copyMakeBorder(codes, 0, below, 0, right, cv2.BORDER_REFLECT)
    shares = network_shares(features(codes, height))
    return shares.reshape(3, len(EDGES_STOPS) - 1, *shares.shape[1:])


def expected_levels(
    shares: Float32, size: tuple[int, ...], l_max: float, wrap_x: bool = False
) -> Float32:
    """The expected log2 of R, G and B of each pixel if clipped, over log2 L'max: (H, W, 3).

    Float32 in [0, 1], for a picture of `size` (H, W) with these `level_shares`.
    """
    height, width = _seen_size(size[0], size[1])
    peak_stops = math.log2(max(l_max, 1 + 1e-6))
    edges = np.minimum(EDGES_STOPS, peak_stops)
    # The last level's share is used for peaks beyond it.
    widths = np.diff([*edges[:-1], max(peak_stops, edges[-1])])
    stops = np.einsum("k,ckhw->hwc", (widths / peak_stops).astype(np.float32), shares)
    padded = 2 * shares.shape[3], 2 * shares.shape[2]
    left = WRAP_PX if wrap_x else 0
    seen = cv2.resize(stops, padded, interpolation=cv2.INTER_LINEAR)
    seen = seen[:height, left : left + width]
    if (height, width) != tuple(size):
        seen = cv2.resize(seen, (size[1], size[0]), interpolation=cv2.INTER_LINEAR)
    seen = np.asarray(seen, np.float32).reshape(size[0], size[1], 3)
    return np.clip(seen, 0, 1, out=seen)


class Clipped(NamedTuple):
    """The channels' mean shares (levels, h, w), how far each pixel clipped, the levels' widths."""

    shares: Float32
    weight: Float32
    widths: Float32


def certainty(there: Clipped) -> float:
    """How certain the network is about a whole picture, in [0, 1]; 1 if nothing has clipped.

    A share of 0 or 1 is certain; in between, the level may be reached or not. The certainty is 1
    minus the sum of s * (1 - s) over that of s, the channels' mean shares of the levels up to
    CERTAIN_STOPS, weighted by their widths and by how far each pixel clipped.
    """
    seen, weight, widths = there
    by_level = np.einsum("hw,khw->k", weight, seen)
    unsure = np.einsum("hw,khw->k", weight, seen * (1 - seen))
    total = float(widths @ by_level)
    return 1 - float(widths @ unsure) / total if total > 0 else 1.0


def mean_stops(there: Clipped) -> float:
    """The mean expected log2 of clipped areas, up to CERTAIN_STOPS; 0 if nothing has clipped.

    The mean over channels, and over pixels weighted by how far each clipped, as in `certainty`.
    """
    seen, weight, widths = there
    total = float(widths @ np.einsum("hw,khw->k", weight, seen))
    return total / max(float(weight.sum()), 1e-6)


def where_clipped(shares: Float32, clipped: Float32, wrap_x: bool = False) -> Clipped:
    """What `certainty` and `mean_stops` need of `level_shares` and how far each pixel clipped.

    `clipped` is (H, W) in [0, 1].
    """
    height, width = _seen_size(*clipped.shape)
    left = WRAP_PX // 2 if wrap_x else 0
    red, green, blue = shares[:, :, : max(1, height // 2), left : left + max(1, width // 2)]
    seen = (red + green + blue) / np.float32(3)  # NumPy's mean takes three times as long
    weight = area_means(clipped, (seen.shape[2], seen.shape[1]))
    widths = np.diff(np.minimum(EDGES_STOPS, CERTAIN_STOPS)).astype(np.float32)
    return Clipped(seen, weight, widths)


def _seen_size(height: int, width: int) -> tuple[int, int]:
    """(height, width) of the network's input for a picture of that size."""
    if width <= 480:
        return height, width
    return max(1, round(height * WIDTH_PX / width)), WIDTH_PX
