"""The compiled form of `auto`'s gains, alone or multiplied with the picture as half floats."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from itmo_video.kernels.compiled import (
    AT_ONCE,
    Bytes2D,
    Codes,
    Float32,
    Half,
    Indices,
    alike,
    columns_between,
    whole,
)
from itmo_video.kernels.compiled_light import CodesToLight, alike_planes, power_curve

_BLOCK, _RUN = 64, 512  # pixels, as in from_codes.c


class GainAuto(NamedTuple):
    """The constants of `operators.auto.gain_auto`, in the order of auto.c.

    `gate` is (from, centre, slope of a power of two, low, white) of how far a channel counts as
    clipped. `steep` is where channels begin to separate, where fully, and whether they may; `along`
    the two levels between which another channel follows the highest one.
    """

    gate: tuple[float, float, float, float, float]
    steep: tuple[float, float, float]
    along: tuple[float, float]
    l_max: float

    def as_array(self, unknown: bool) -> Float32:
        """The array for C; `unknown` if everything that clips goes to L'max."""
        gate, steep, along, l_max = self
        return np.array([*gate, *steep, l_max, *along, float(unknown)], np.float32)


class SmallMaps(NamedTuple):
    """Maps at analysis size, and the positions of the picture's rows in them.

    `planes` (p, h, w) hold the two planes of the noise guard if there are `guards`, and then maps;
    `used` (p, h), uint8, tells which rows of them are not all 0. `numbers` is the plane of each of
    the four maps, -1 for one that is 0; `is_known` is False if there are no maps. `above` and
    `parts` give for each row the row of `planes` above it, and the
    weight of the one below.
    """

    planes: Float32
    used: Bytes2D
    guards: bool
    numbers: tuple[int, int, int, int]
    is_known: bool
    above: Indices
    parts: Float32


def auto_from_codes(
    loaded: ctypes.CDLL,
    planes: Sequence[Codes],
    rows: slice,
    codes: CodesToLight,
    maps: SmallMaps,
    numbers: GainAuto,
    strength: float,
    out: Half,
) -> None:
    """`ycbcr_rows`, `guide_rows` and `expand_auto` of some rows in one pass.

    `codes` has an exponent; `out` (3, rows, W) holds three contiguous planes.
    """
    luma, cb, cr = alike_planes(planes, rows)
    (count, height, width), shape = maps.planes.shape, luma.shape
    if codes.exponent is None or max(maps.numbers) >= count or 2 * maps.guards > count:
        raise ValueError("codes or maps do not fit")
    if len(maps.above) != rows.stop - rows.start:
        raise ValueError(f"{len(maps.above)} rows of maps for {rows.stop - rows.start}")
    alike(maps.above, maps.parts)
    if maps.used.shape != maps.planes.shape[:2]:
        raise ValueError(f"rows {maps.used.shape} of maps {maps.planes.shape}")
    alike(luma[rows], *out)
    columns, shares = columns_between(width, shape[1])
    black, span = codes.levels[:2]
    sizes = np.array(
        [luma.itemsize, shape[1], cb.shape[1], cb.shape[0], rows.start, rows.stop - rows.start,
         *codes.sites_in_halves, count, height, width, maps.guards, len(luma)], np.int64,
    )  # fmt: skip
    light = np.array(
        [*codes.black_and_scale, *codes.matrix, 1 / span, -black / span, strength], np.float32
    )
    across = (shape[1] + AT_ONCE + _RUN) // _BLOCK * _BLOCK
    room = (24 + count) * across + 2 * (count * (width + 1) + AT_ONCE) + cb.shape[1] + 2
    loaded.itmo_auto_from_codes(
        luma, cb, cr,
        luma.strides[0], np.array([cb.strides[0], cr.strides[0]], np.int64), sizes, light,
        power_curve(codes.exponent), whole(maps.planes), maps.above, maps.parts, columns, shares,
        np.array(maps.numbers, np.int64), maps.used, numbers.as_array(not maps.is_known),
        np.zeros(room, np.float32),
        *out,
    )  # fmt: skip


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
    """`operators.auto.gain_auto` of three planes: new arrays."""
    given = _given_to_auto(rgb, ratio, maps, numbers)
    out = [np.empty(rgb[0].shape, np.float32) for _ in rgb]
    loaded.itmo_gain_auto(
        *given, *rgb[0].shape, _room_to_separate(rgb[0]),
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
    """Write three planes times 1 + `strength` * (gain_auto - 1) to `out` (three planes, half).

    Rounded to the nearest half; overflow becomes infinity.
    """
    given = _given_to_auto(rgb, ratio, maps, numbers)
    alike(rgb[0], *out)
    loaded.itmo_expand_auto(
        *given, strength, *rgb[0].shape, _room_to_separate(rgb[0]),
        *out,
    )  # fmt: skip


def _given_to_auto(
    rgb: Sequence[Float32], ratio: Float32 | None, maps: Sequence[Float32], numbers: GainAuto
) -> list[Float32 | None]:
    """Planes, ratio, four maps and constants for auto.c; a map that is missing or 0 is None."""
    planes = [whole(plane) for plane in rgb]
    smoothed = None if ratio is None else whole(ratio)
    levels = [None if is_nothing(plane) else whole(plane) for plane in maps] or [None] * 4
    alike(*planes, smoothed, *levels)
    return [*planes, smoothed, *levels, numbers.as_array(not maps)]


def _room_to_separate(plane: Float32) -> Float32:
    width = plane.shape[1]  # as in separation_of of auto_gains.h
    return np.zeros(12 * width + 6 + 4 * (width // _BLOCK + 1), np.float32)


def is_nothing(plane: Float32) -> bool:
    """Whether a map is a single 0 for all pixels: see guidance.Guidance.rows."""
    return plane.strides == (0, 0) and not plane.any()
