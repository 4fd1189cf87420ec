"""The compiled form of `auto`'s network: convolutions by Winograd's F(4 x 4, 3 x 3)."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Iterable

import numpy as np

from itmo_video.kernels.compiled import Float32, whole

CHANNELS = (24, 32, 48, 64, 96)  # as in network.c
GIVEN, SHOWN = 17, 30
_LANES, _PADDED = 8, 24
_PLACES = 36
_TILES_FLOATS = _PLACES * 12 * 160
_DEEPEST = 2 ** (len(CHANNELS) - 1)


def shares(loaded: ctypes.CDLL, features: Float32, weights: Float32) -> Float32:
    """The network's output, float32 (30, h, w), of its features (17, h, w).

    h and w are multiples of 16; `weights` are those of `packed`.
    """
    count, height, width = features.shape
    if count != GIVEN or height % _DEEPEST or width % _DEEPEST or len(weights) != _weights_count():
        raise ValueError(f"features {features.shape}, {len(weights)} weights")
    area = height * width
    kept = sum((area >> 2 * level) * channels for level, channels in enumerate(CHANNELS))
    out = np.empty((SHOWN, height, width), np.float32)
    loaded.itmo_network(
        whole(features), height, width, weights,
        np.empty(_TILES_FLOATS + 3 * area * _PADDED + kept, np.float32), out,
    )  # fmt: skip
    return out


def features(
    loaded: ctypes.CDLL, codes: Float32, height: int, gate: tuple[float, float]
) -> Float32:
    """`auto_levels.features` with the gate's centre and slope."""
    rows, columns = codes.shape[0] // 2, codes.shape[1] // 2
    if codes.shape != (2 * rows, 2 * columns, 3):
        raise ValueError(f"codes of shape {codes.shape}")
    centre, slope = gate
    most = 1 + math.exp(-slope * (1 - centre))
    out = np.empty((GIVEN, rows, columns), np.float32)
    loaded.itmo_network_features(
        whole(codes), rows, columns, slope / math.log(2), centre, most,
        2 / max(height / 2 - 1, 1), out,
    )  # fmt: skip
    return out


def srgb_codes(loaded: ctypes.CDLL, rgb_linear: Float32) -> Float32:
    """`auto_levels.srgb_codes`."""
    light = whole(rgb_linear)
    out = np.empty_like(light)
    loaded.itmo_srgb_codes(light, light.size, out)
    return out


def packed(loaded: ctypes.CDLL, layers: Iterable[tuple[Float32, Float32]]) -> Float32:
    """Weights (out, in, 3, 3) or (out, in, 1, 1) and biases (out,) of all layers, for `shares`.

    Channels of 0 make up vectors. Each 3 x 3 becomes 6 x 6 places (winograd.h).
    """
    parts: list[Float32] = []
    for weight, bias in layers:
        kept, channels, size, _ = weight.shape
        wide, deep = -(-kept // _LANES) * _LANES, -(-channels // _LANES) * _LANES
        if size == 3:
            parts.append(np.zeros(_PLACES * wide * deep, np.float32))
            loaded.itmo_network_filters(whole(weight), kept, channels, deep, parts[-1])
        else:
            parts.append(np.pad(weight[..., 0, 0].T, ((0, 0), (0, wide - kept))).ravel())
        parts.append(np.pad(bias, (0, wide - kept)))
    return np.concatenate(parts)


def _weights_count() -> int:
    across = list(zip((_PADDED, *CHANNELS), CHANNELS, strict=False))
    up = list(zip(CHANNELS[:0:-1], CHANNELS[-2::-1], strict=True))
    three = sum(_PLACES * (i * o + o * o) + 2 * o for i, o in across)
    three += sum(_PLACES * ((i + o) * o + o * o) + 2 * o for i, o in up)
    deepest, padded = CHANNELS[-1], SHOWN + -SHOWN % _LANES
    return three + 2 * deepest * (deepest + 1) + padded * (CHANNELS[0] + 1)
