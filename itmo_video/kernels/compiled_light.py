"""The compiled form of codes to light, and its constants."""

from __future__ import annotations

import ctypes
import functools
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from itmo_video.kernels.compiled import Codes, Float32, alike, check_rows, in_lines


class CodesToLight(NamedTuple):
    """How Y'CbCr codes represent R'G'B' or linear light.

    `sites` (across, down) are None if chroma is as large as luma, otherwise chroma.siting_offset's.
    `levels` are the codes of black and of white above it, then those of neutral chroma and of
    chroma's range; `matrix` what Cr adds to red, Cb to blue, Cr to green and Cb to green, per unit
    of that range. With an `exponent` (2 to 4), values are clipped to [0, 1] and raised to it,
    within 1e-6; values below 2^-15 give 0, as their powers are far below the smallest half.
    """

    sites: tuple[float | None, float | None]
    levels: tuple[float, float, float, float]
    matrix: tuple[float, float, float, float]
    exponent: float | None

    @property
    def sites_in_halves(self) -> tuple[int, int]:
        """The sites for C: -1 for None, otherwise 0 to 2."""
        across, down = (-1 if site is None else round(2 * site) for site in self.sites)
        return across, down

    @property
    def black_and_scale(self) -> tuple[float, float, float, float]:
        """`levels` with the values of one code of luma and of chroma."""
        black, span, middle, chroma_span = self.levels
        return black, _one_over(span), middle, _one_over(chroma_span)


def ycbcr_rows(
    loaded: ctypes.CDLL,
    planes: Sequence[Codes],
    rows: slice,
    codes: CodesToLight,
    out: Sequence[Float32],
) -> None:
    """Convert rows of a Y'CbCr picture to R'G'B', in three float32 arrays of (rows, width).

    `planes` are complete, uint8 or uint16; chroma is as large as luma, half as wide, or half as
    wide and half as high. The result does not depend on strips.
    """
    luma, cb, cr = alike_planes(planes, rows)
    alike(luma[rows], *out)
    power = None if codes.exponent is None else power_curve(codes.exponent)
    _rows(loaded.itmo_ycbcr_rows, (luma, cb, cr), rows, codes, power, out)


def halved_light(
    loaded: ctypes.CDLL, planes: Sequence[Codes], codes: CodesToLight, out: Sequence[Float32]
) -> None:
    """Linear light as `ycbcr_rows`, averaged over 2 x 2 pixels: three float32 (H / 2, W / 2).

    `codes` has an exponent; the picture's sides are even.
    """
    height, width = planes[0].shape
    luma, cb, cr = alike_planes(planes, slice(0, height))
    alike(*out)
    if height % 2 or width % 2 or out[0].shape != (height // 2, width // 2):
        raise ValueError(f"{width}x{height} codes halved to {out[0].shape}")
    if codes.exponent is None:
        raise ValueError("light is not a power of these codes")
    rows, power = slice(0, height // 2), power_curve(codes.exponent)
    _rows(loaded.itmo_halved_light, (luma, cb, cr), rows, codes, power, out)


def _rows(
    kernel: Callable[..., None],
    planes: tuple[Codes, Codes, Codes],
    rows: slice,
    codes: CodesToLight,
    power: Float32 | None,
    out: Sequence[Float32],
) -> None:
    luma, cb, cr = planes
    height, width = cb.shape
    strides = np.array([cb.strides[0], cr.strides[0]], np.int64)
    across, down = codes.sites_in_halves
    kernel(
        luma, cb, cr,
        luma.strides[0], strides, luma.itemsize,
        luma.shape[1], width, height, rows.start, rows.stop - rows.start, across, down,
        np.array(codes.black_and_scale, np.float32), np.array(codes.matrix, np.float32), power,
        np.empty(5 * width + 2 + 7 * luma.shape[1], np.float32),
        *out,
    )  # fmt: skip


def _one_over(span: float) -> float:
    """The factor whose product with `span` is 1 in float32, too, so that white stays white."""
    scale = np.float32(1 / span)
    return float(scale if np.float32(span) * scale >= 1 else np.nextafter(scale, np.float32(1)))


@functools.lru_cache(maxsize=8)
def power_curve(exponent: float) -> Float32:
    """The constants of `itmo_power`: float32 (21,), for an exponent of 2 to 4.

    A value is (1 + t) * 2^e, t from 0 to 1. First are the coefficients of t to t^5 in
    (1 + t)^exponent, within 5e-7: those of t to t^4 in ((1 + t)^exponent - 1) / t, interpolated at
    Chebyshev nodes by divided differences. Then 2^(exponent * e) for e from -15 to 0.
    """
    places = [0.5 - 0.5 * math.cos(math.pi * (k + 0.5) / 5) for k in range(5)]
    values = [((1 + t) ** exponent - 1) / t for t in places]
    for order in range(1, 5):
        for k in range(4, order - 1, -1):
            values[k] = (values[k] - values[k - 1]) / (places[k] - places[k - order])
    terms = [0.0] * 5
    for place, value in zip(reversed(places), reversed(values), strict=True):
        terms = [below - place * term for below, term in zip([0.0, *terms], terms, strict=False)]
        terms[0] += value
    scales = [2.0 ** (exponent * e) for e in range(-15, 1)]
    return np.array([*terms, *scales], np.float32)


def alike_planes(planes: Sequence[Codes], rows: slice) -> tuple[Codes, Codes, Codes]:
    """Luma, Cb and Cr as the kernels read them; raises ValueError if they do not match."""
    luma, cb, cr = (in_lines(plane) for plane in planes)
    if len({plane.dtype for plane in (luma, cb, cr)}) > 1:
        raise TypeError("luma and chroma have codes of different sizes")
    alike(cb, cr)
    check_rows(rows, luma)
    return luma, cb, cr
