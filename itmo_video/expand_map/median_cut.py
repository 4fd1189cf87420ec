"""Finding the lights of a picture with the median cut (Debevec 2005; section 2.2 of the paper).

All sums are exact: luminance is first rounded to multiples of a power of two that is fine enough
for video (35 bits below the picture's maximum at 512x288). Whole numbers have the same sum in any
order, so a cut, ties included, depends only on the picture, and scaling a picture by a power of two
moves no light.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from itmo_video.model import Float64

Int32: TypeAlias = npt.NDArray[np.int32]
Int64: TypeAlias = npt.NDArray[np.int64]
Luminance: TypeAlias = npt.NDArray[np.floating[Any]]

_FLOAT64_BITS = 53  # whole numbers up to 2^53 are exact in float64, so every power is
_MOMENT_BITS = 62  # sums of position * luminance stay inside int64
_MAX_EXPONENT = 1000  # keeps the scale itself a finite float64


class Lights(NamedTuple):
    """The lights of one picture, in the order of the cuts (halves stay adjacent).

    `x`, `y`: float64 (n,), positions in pixels, pixel centres at whole numbers.
    `power`: float64 (n,), luminance summed over the light's region (luminance * pixels).
    `regions`: int32 (n, 4), the regions as x0, y0, x1, y1, half-open, which tile the picture.
    """

    x: Float64
    y: Float64
    power: Float64
    regions: Int32


def median_cut(
    luminance: Luminance, n_lights: int = 1024, row_weight: Luminance | None = None
) -> Lights:
    """Split a picture into at most `n_lights` regions of about equal power, with a light in each.

    Each of log2(n_lights) rounds cuts every region across its longer side (its width if equal)
    where the sums of the halves are closest to each other, at the first such place on a tie.
    One-pixel regions stay. The light is at the centroid, or at the centre of a black region.

    `luminance`: (H, W) floats, linear, finite, >= 0. `row_weight`: (H,) floats >= 0 that multiply
    the rows: the cosine of latitude for latitude-longitude panoramas, as in Debevec 2005; None
    otherwise (section 2.2). Raises ValueError for anything else and for an `n_lights` that is
    not a power of two.
    """
    if n_lights < 1 or n_lights & (n_lights - 1):
        raise ValueError(f"n_lights must be a power of two, not {n_lights}")
    units, unit = quantise(luminance, row_weight)
    height, width = units.shape
    table = _SummedArea(np.asarray(cv2.integral(units, sdepth=cv2.CV_64F), dtype=np.float64))

    regions = np.array([[0, 0, width, height]], dtype=np.int64)
    for _ in range(n_lights.bit_length() - 1):
        regions = _cut_all(table, regions)

    total = table.total(regions)
    x = _centroid(table, regions, total, along_x=True)
    y = _centroid(table, regions, total, along_x=False)
    return Lights(x, y, total * unit, regions.astype(np.int32))


def quantise(luminance: Luminance, row_weight: Luminance | None = None) -> tuple[Float64, float]:
    """Round weighted luminance to whole units, as fine as exact sums allow.

    Returns float64 (H, W), whole numbers >= 0, and the unit, a power of two in the picture's unit
    of luminance. Raises ValueError for input that `median_cut` does not accept.
    """
    if luminance.ndim != 2 or luminance.size == 0:
        raise ValueError(f"luminance must be a picture (H, W), not of shape {luminance.shape}")
    values = luminance.astype(np.float64)
    if row_weight is not None:
        if row_weight.shape != (values.shape[0],) or not bool(np.all(row_weight >= 0.0)):
            raise ValueError(f"row_weight must hold {values.shape[0]} numbers >= 0, one per row")
        values *= row_weight[:, np.newaxis]
    peak = float(values.max())
    if not (float(values.min()) >= 0.0 and math.isfinite(peak)):  # also catches NaN
        raise ValueError("luminance must be finite and not negative")

    sum_bits = (values.size - 1).bit_length()
    moment_bits = sum_bits + (max(values.shape) - 1).bit_length()
    pixel_bits = min(_FLOAT64_BITS - sum_bits, _MOMENT_BITS - moment_bits)
    # The exponent of the maximum, not the maximum, so that rounding is the same for all pictures
    # of about this brightness, and far below what a camera can resolve.
    exponent = min(pixel_bits - math.frexp(peak)[1], _MAX_EXPONENT)
    values *= math.ldexp(1.0, exponent)
    np.rint(values, out=values)
    return values, math.ldexp(1.0, -exponent)


class _SummedArea:
    """A summed-area table with the sums needed for cuts and centroids."""

    def __init__(self, sums: Float64) -> None:
        self._flat = sums.ravel()
        self._stride = sums.shape[1]

    def total(self, regions: Int64) -> Float64:
        """Sum of each region; (n, 4) to (n,)."""
        x0, y0, x1, y1 = regions.T
        top, bottom = y0 * self._stride, y1 * self._stride
        flat = self._flat
        sums: Float64 = flat[bottom + x1] - flat[bottom + x0] - flat[top + x1] + flat[top + x0]
        return sums

    def prefixes(self, regions: Int64, along_x: Int64, counts: Int64) -> tuple[Float64, Int64]:
        """Sum of the first 1, 2, .. counts[i] columns (rows where `along_x` is 0) of each region.

        Returns all of them in one array, region after region, and where each region starts.
        """
        x0, y0, x1, y1 = regions.T
        stride = self._stride
        step = np.where(along_x, 1, stride)
        near = y0 * stride + x0
        far = np.where(along_x, y1 * stride + x0, y0 * stride + x1)
        starts = np.cumsum(counts) - counts
        ramp = np.arange(1, int(counts.sum()) + 1) - np.repeat(starts, counts)
        ramp *= np.repeat(step, counts)
        base = self._flat[far] - self._flat[near]
        sums = self._flat[ramp + np.repeat(far, counts)]
        sums -= self._flat[ramp + np.repeat(near, counts)]
        sums -= np.repeat(base, counts)
        return sums, starts


def _cut_all(table: _SummedArea, regions: Int64) -> Int64:
    """One round: splits each region of more than one pixel; (n, 4) to (up to 2n, 4)."""
    widths = regions[:, 2] - regions[:, 0]
    heights = regions[:, 3] - regions[:, 1]
    divisible = np.maximum(widths, heights) > 1
    if not bool(divisible.any()):
        return regions
    whole = regions[divisible]
    along_x = (widths >= heights)[divisible].astype(np.int64)
    counts = np.maximum(widths, heights)[divisible] - 1  # possible places of a cut

    sums, starts = table.prefixes(whole, along_x, counts)
    imbalance = np.abs(2 * sums - np.repeat(table.total(whole), counts))
    least = np.minimum.reduceat(imbalance, starts)
    candidates = np.flatnonzero(imbalance == np.repeat(least, counts))
    first = candidates[np.searchsorted(candidates, starts)]  # the first of each region's ties
    lengths = first - starts + 1

    halves = np.repeat(regions, np.where(divisible, 2, 1), axis=0)
    left = np.flatnonzero(divisible) + np.arange(len(whole))  # its place after those before it
    cut = whole[:, 0] * along_x + whole[:, 1] * (1 - along_x) + lengths
    halves[left, 3 - along_x] = cut  # x1 of the left half, or y1 of the upper one
    halves[left + 1, 1 - along_x] = cut  # x0 of the right half, or y0 of the lower one
    return halves


def _centroid(table: _SummedArea, regions: Int64, total: Float64, *, along_x: bool) -> Float64:
    """Luminance-weighted mean position on one axis in pixels; the centre if black; (n,)."""
    low, high = (regions[:, 0], regions[:, 2]) if along_x else (regions[:, 1], regions[:, 3])
    length = high - low
    sums, starts = table.prefixes(regions, np.full_like(length, along_x), length)
    # Summing the prefixes counts column k of a region (length - k) times.
    # In int64, as only this sum can exceed what float64 holds exactly.
    moment = length * total.astype(np.int64) - np.add.reduceat(sums.astype(np.int64), starts)
    centre = 0.5 * (length - 1)
    offset: Float64 = np.divide(moment.astype(np.float64), total, out=centre, where=total > 0.0)
    offset += low
    return offset
