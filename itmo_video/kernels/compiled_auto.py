"""The compiled form of `auto`'s gains, by themselves or times the picture as half floats."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from itmo_video.kernels.compiled import Float32, Half, alike, whole


class GainAuto(NamedTuple):
    """The numbers of `operators.auto.gain_auto`, in the order of auto.c's.

    `gate` is (from, centre, slope of a power of two, low, white) of a channel's opening, `steep`
    where a channel parts from the others, wholly, and whether it may, `bound` how far it may beside
    an unclipped one, and between which two levels that one counts as clipped.
    """

    gate: tuple[float, float, float, float, float]
    steep: tuple[float, float, float]
    bound: tuple[float, float, float]
    l_max: float


def ramps(loaded: ctypes.CDLL, values: Float32, low: float, high: float) -> Float32:
    """`operators.ramps.ramps`: a new array."""
    values = whole(values)
    out = np.empty_like(values)
    loaded.itmo_ramps(values, low, 1 / (high - low), values.size, out)
    return out


def gain_auto(
    loaded: ctypes.CDLL,
    rgb: Sequence[Float32],
    ratio: Float32 | None,
    maps: Sequence[Float32],
    numbers: GainAuto,
) -> list[Float32]:
    """The gains of three planes as `operators.auto.gain_auto` has them: new arrays."""
    given = _given_to_auto(rgb, ratio, maps, numbers)
    out = [np.empty(rgb[0].shape, np.float32) for _ in rgb]
    loaded.itmo_gain_auto(
        *given, out[0].size,
        *out,
    )  # fmt: skip
    return out


def expand_auto(
    loaded: ctypes.CDLL,
    rgb: Sequence[Float32],
    ratio: Float32 | None,
    maps: Sequence[Float32],
    numbers: GainAuto,
    strength: float,
    out: Half,
) -> None:
    """Three planes times 1 + `strength` * (gain_auto - 1) as halves into `out`, which holds three.

    Rounded to the nearest half; what is too large becomes infinite.
    """
    given = _given_to_auto(rgb, ratio, maps, numbers)
    alike(rgb[0], *out)
    loaded.itmo_expand_auto(
        *given, strength, rgb[0].size,
        *out,
    )  # fmt: skip


def _given_to_auto(
    rgb: Sequence[Float32], ratio: Float32 | None, maps: Sequence[Float32], numbers: GainAuto
) -> list[Float32 | None]:
    """Planes, ratio, four maps and numbers as auto.c has them: no map is None, nor is one of 0."""
    planes = [whole(plane) for plane in rgb]
    smoothed = None if ratio is None else whole(ratio)
    levels = [None if is_nothing(plane) else whole(plane) for plane in maps] or [None] * 4
    alike(*planes, smoothed, *levels)
    gate, steep, bound, l_max = numbers
    unknown = float(not maps)  # all that clips goes to L'max
    values = np.array([*gate, *steep, l_max, *bound, unknown], np.float32)
    return [*planes, smoothed, *levels, values]


def is_nothing(plane: Float32) -> bool:
    """Whether a map is one value for all places, which is 0: see guidance.Guidance.rows."""
    return plane.strides == (0, 0) and not plane.any()
