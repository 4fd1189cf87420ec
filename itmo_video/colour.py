"""From a frame's integer codes to linear R, G, B, and between sets of primaries.

The strip is the unit: every row of the result is computed from the same operands in the same order
whichever strip it is in, so a strip equals the same rows of the whole picture bit for bit. Chroma
is interpolated linearly between its sample positions; at the edges the last sample is repeated.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from typing import TypeAlias, cast

import cv2
import numpy as np

from itmo_video.model import (
    ChromaSiting,
    Code,
    Float32,
    Float64,
    Frame,
    Matrix,
    Range,
    Transfer,
)

Planes: TypeAlias = tuple[Float32, Float32, Float32]

STRIP_ROWS = 40  # the buffers of such a strip of 1080p stay in a core's second-level cache

# Padding widths to this makes every cv2 call free of a scalar tail, whose rounding may differ
# from that of the vector loop and would make a row depend on its strip.
_LANES = 128

LUMINANCE_KR_KB: dict[Matrix, tuple[float, float]] = {
    "bt709": (0.2126, 0.0722),  # ITU-R BT.709-6, 3.2
    "bt601": (0.299, 0.114),  # ITU-R BT.601-7, 2.5.1
    "bt2020": (0.2627, 0.0593),  # ITU-R BT.2020-2, table 4, non-constant luminance
}

LUMINANCE_WEIGHTS = (0.2126, 0.7152, 0.0722)  # BT.709-6, for measurements; the paper's differ

_D65 = (0.3127, 0.3290)
_ACES_WHITE = (0.32168, 0.33767)
CHROMATICITIES: dict[str, tuple[float, ...]] = {
    "rec709": (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, *_D65),
    "rec601_525": (0.630, 0.340, 0.310, 0.595, 0.155, 0.070, *_D65),
    "rec601_625": (0.64, 0.33, 0.29, 0.60, 0.15, 0.06, *_D65),
    "rec2020": (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, *_D65),
    "p3d65": (0.680, 0.320, 0.265, 0.690, 0.150, 0.060, *_D65),
    "acescg": (0.713, 0.293, 0.165, 0.830, 0.128, 0.044, *_ACES_WHITE),  # AP1
    "aces2065-1": (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, *_ACES_WHITE),  # AP0
}
"""rx, ry, gx, gy, bx, by, wx, wy of each set of primaries, sources' and outputs'."""

_BRADFORD = np.array(
    [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]]
)

_GAMMA: dict[Transfer, float] = {"bt1886": 2.4, "gamma22": 2.2, "linear": 1.0}
# IEC 61966-2-1 as published: slope, offset, exponent, and where the line ends in code and light.
_SRGB_SLOPE, _SRGB_OFFSET, _SRGB_POWER = 12.92, 0.055, 2.4
_SRGB_CODE, _SRGB_LIGHT = 0.04045, 0.0031308
# 0 has no logarithm, and the power of this floor is still no subnormal.
_POWER_FLOOR = 1e-8
_FROM_ZERO = ("linear", "srgb")  # these take no power of a code near 0


def to_rgb_code(frame: Frame) -> Planes:
    """Give the frame as nonlinear R'G'B', nominally 0 to 1, over-white and negative values kept.

    Three float32 planes of the frame's height and width.
    """
    planes = _empty_planes(frame)
    for rows, out in _strips(frame, planes):
        _strip_code(frame, rows, out)
    return planes


def to_rgb_linear(frame: Frame, *, clip: bool) -> Planes:
    """Give the frame as linear R, G, B in the source's own primaries, SDR white at 1.

    Three float32 planes of the frame's height and width. With `clip` the codes are limited to
    [0, 1] first; without it over-white stays above 1 and negative codes give negative light.
    """
    planes = _empty_planes(frame)
    for rows, out in _strips(frame, planes):
        strip_to_rgb_linear(frame, rows, clip, out)
    return planes


def strip_to_rgb_linear(frame: Frame, rows: slice, clip: bool, out: Planes) -> None:
    """Write the given rows of `to_rgb_linear` into three float32 arrays of (rows, width).

    Any strip gives bit for bit the rows of the whole frame; about 40 rows are fastest. Raises
    ValueError where the encoding's transfer is PQ or HLG.
    """
    encoding = frame.encoding
    if encoding.family != "ycbcr":
        table = _linear_table(encoding.bit_depth, encoding.range, encoding.transfer, clip)
        for plane, target in zip(_colour_planes(frame), out, strict=True):
            cv2.LUT(plane[rows], table, dst=target)
        return
    width = frame.size[0]
    buffers = out if width % _LANES == 0 else _buffers(out[0].shape[0], _padded_width(width))
    _ycbcr_strip(frame, rows, buffers)
    for buffer, target in zip(buffers, out, strict=True):
        _eotf_in_place(buffer, encoding.transfer, clip)
        if target is not buffer:
            np.copyto(target, buffer[:, :width])


def eotf(code: Float64 | Float32, transfer: Transfer) -> Float64:
    """Display light, 1 at code 1, of nonlinear codes; odd-symmetric for negative codes.

    Any shape; float64 out. BT.1886 with a black of 0 is a power of 2.4 (ITU-R BT.1886), sRGB is
    IEC 61966-2-1. Raises ValueError for PQ and HLG, which have no display white of 1.
    """
    x = np.asarray(code, np.float64)
    size = np.abs(x)
    if transfer == "srgb":
        power = ((size + _SRGB_OFFSET) / (1 + _SRGB_OFFSET)) ** _SRGB_POWER
        light = np.where(size <= _SRGB_CODE, size / _SRGB_SLOPE, power)
    else:
        light = size ** _gamma(transfer)
    return np.copysign(light, x)


def inverse_eotf(light: Float64 | Float32, transfer: Transfer) -> Float64:
    """Give the nonlinear code of display light: the inverse of `eotf`, with the same domain."""
    y = np.asarray(light, np.float64)
    size = np.abs(y)
    if transfer == "srgb":
        power = (1 + _SRGB_OFFSET) * size ** (1 / _SRGB_POWER) - _SRGB_OFFSET
        code = np.where(size <= _SRGB_LIGHT, size * _SRGB_SLOPE, power)
    else:
        code = size ** (1 / _gamma(transfer))
    return np.copysign(code, y)


def rgb_to_xyz_matrix(primaries: str) -> Float64:
    """3x3 float64 from linear RGB to CIE XYZ with Y = 1 at RGB white (SMPTE RP 177)."""
    x, y = np.array(CHROMATICITIES[primaries]).reshape(4, 2).T
    xyz = np.stack((x / y, np.ones(4), (1 - x - y) / y))
    scale = np.linalg.solve(xyz[:, :3], xyz[:, 3])
    return np.asarray(xyz[:, :3] * scale, np.float64)


def luminance_weights(primaries: str) -> tuple[float, float, float]:
    """Give the weights of linear R, G and B in luminance for these primaries; they sum to 1."""
    red, green, blue = rgb_to_xyz_matrix(primaries)[1]
    return float(red), float(green), float(blue)


def nearest_primaries(xy: Sequence[float]) -> str:
    """The name in CHROMATICITIES that these rx, ry, gx, gy, bx, by, wx, wy are nearest to."""
    return min(
        CHROMATICITIES, key=lambda name: float(np.abs(np.subtract(CHROMATICITIES[name], xy)).sum())
    )


def rgb_to_rgb_matrix(source: str, target: str) -> Float64:
    """3x3 float64 that takes linear RGB in one set of primaries to another.

    Names are those of `CHROMATICITIES`. White goes to white: differing white points are adapted
    by Bradford's cone responses (Lam 1985). Raises KeyError for an unknown name.
    """
    if source == target:
        return np.eye(3)
    to_xyz, from_xyz = rgb_to_xyz_matrix(source), np.linalg.inv(rgb_to_xyz_matrix(target))
    if CHROMATICITIES[source][6:] == CHROMATICITIES[target][6:]:
        return np.asarray(from_xyz @ to_xyz, np.float64)
    ratio = _white_cone(target) / _white_cone(source)
    adapt = np.linalg.solve(_BRADFORD, ratio[:, None] * _BRADFORD)
    return np.asarray(from_xyz @ adapt @ to_xyz, np.float64)


def upsample_chroma(plane: Code, size: tuple[int, int], siting: ChromaSiting) -> Float64:
    """Bring a subsampled plane to full (width, height), linearly interpolated, in code units.

    For any whole subsampling factor, slow and plain; float64, exact for 8 to 16-bit codes.
    `strip_to_rgb_linear` is its fast twin for factors of 2.
    """
    width, height = size
    rows = _interpolate(plane.astype(np.float64), height, _offset(siting, vertical=True))
    return _interpolate(rows.T, width, _offset(siting, vertical=False)).T


# ---- a strip of Y'CbCr ----


def _strip_code(frame: Frame, rows: slice, out: Planes) -> None:
    if frame.encoding.family != "ycbcr":
        table = _code_table(frame.encoding.bit_depth, frame.encoding.range)
        for plane, target in zip(_colour_planes(frame), out, strict=True):
            cv2.LUT(plane[rows], table, dst=target)
        return
    width = frame.size[0]
    buffers = _buffers(out[0].shape[0], _padded_width(width))
    _ycbcr_strip(frame, rows, buffers)
    for buffer, target in zip(buffers, out, strict=True):
        np.copyto(target, buffer[:, :width])


def _ycbcr_strip(frame: Frame, rows: slice, out: Planes) -> None:
    """R'G'B' of some rows, `out` having the padded width."""
    encoding, padded = frame.encoding, out[0].shape[1]
    luma_codes, cb_codes, cr_codes = frame.planes[:3]
    kr, kb = LUMINANCE_KR_KB[encoding.matrix]
    kg = 1 - kr - kb
    red, green, blue = out
    luma = cv2.LUT(_pad(luma_codes[rows], padded), _code_table(encoding.bit_depth, encoding.range))
    cb = _chroma_strip(cb_codes, frame, rows, padded)
    cr = _chroma_strip(cr_codes, frame, rows, padded)
    cv2.scaleAdd(cr, 2 * (1 - kr), luma, dst=red)
    cv2.scaleAdd(cb, 2 * (1 - kb), luma, dst=blue)
    cv2.scaleAdd(cr, -2 * (1 - kr) * kr / kg, luma, dst=green)
    cv2.scaleAdd(cb, -2 * (1 - kb) * kb / kg, green, dst=green)


def _chroma_strip(plane: Code, frame: Frame, rows: slice, padded: int) -> Float32:
    """Cb or Cr of some rows of the full picture, nominally -0.5 to 0.5, of the padded width."""
    (width, height), siting = frame.size, frame.encoding.siting
    table = _chroma_table(frame.encoding.bit_depth, frame.encoding.range)
    by_x, by_y = width > plane.shape[1], height > plane.shape[0]
    across = padded // 2 if by_x else padded
    if not by_y:
        strip = cv2.LUT(_pad(plane[rows], across), table)
    else:
        first, last = rows.start // 2 - 1, (rows.stop - 1) // 2 + 2
        inner = plane[max(first, 0) : min(last, plane.shape[0])]
        above, below = max(-first, 0), max(last - plane.shape[0], 0)
        values = cv2.LUT(_pad(inner, across, above, below), table)
        doubled = _double_rows(values, _offset(siting, vertical=True))
        skip = rows.start - 2 * (first + 1)
        strip = doubled[skip : skip + rows.stop - rows.start]
    return _double_columns(strip, _offset(siting, vertical=False)) if by_x else strip


def _double_rows(values: Float32, offset: float) -> Float32:
    """Twice the inner rows: (n + 2, w) with a neighbour row at each end to (2 n, w)."""
    count, across = values.shape[0] - 2, values.shape[1]
    out = np.empty((count, 2, across), np.float32)
    here, before, after = values[1:-1], values[:-2], values[2:]
    if offset == 0.5:  # even rows lean on the sample above, odd rows on the one below
        cv2.addWeighted(here, 0.75, before, 0.25, 0, dst=out[:, 0])
        cv2.addWeighted(here, 0.75, after, 0.25, 0, dst=out[:, 1])
    elif offset == 0:
        np.copyto(out[:, 0], here)
        cv2.addWeighted(here, 0.5, after, 0.5, 0, dst=out[:, 1])
    else:
        cv2.addWeighted(here, 0.5, before, 0.5, 0, dst=out[:, 0])
        np.copyto(out[:, 1], here)
    return out.reshape(2 * count, across)


def _double_columns(values: Float32, offset: float) -> Float32:
    """(n, w) to (n, 2 w): two columns for each, interleaved by cv2.merge, which is a plain copy."""
    rows, across = values.shape
    around = cv2.copyMakeBorder(values, 0, 0, 1, 1, cv2.BORDER_REPLICATE)
    before, after = around[:, :-2], around[:, 2:]
    if offset == 0.5:
        even = cv2.addWeighted(values, 0.75, before, 0.25, 0)
        odd = cv2.addWeighted(values, 0.75, after, 0.25, 0)
    elif offset == 0:
        even, odd = values, cv2.addWeighted(values, 0.5, after, 0.5, 0)
    else:
        even, odd = cv2.addWeighted(values, 0.5, before, 0.5, 0), values
    return np.asarray(cv2.merge((even, odd)), np.float32).reshape(rows, 2 * across)


def _eotf_in_place(code: Float32, transfer: Transfer, clip: bool) -> None:
    if clip:
        np.clip(code, 0 if transfer in _FROM_ZERO else _POWER_FLOOR, 1, out=code)
        _eotf_of_positive(code, transfer)
        return
    signed = code.copy()
    np.abs(code, out=code)
    if transfer not in _FROM_ZERO:
        cv2.max(code, _POWER_FLOOR, dst=code)
    _eotf_of_positive(code, transfer)
    np.copysign(code, signed, out=code)


def _eotf_of_positive(code: Float32, transfer: Transfer) -> None:
    """In place, of codes not below _POWER_FLOOR, or not below 0 for those of _FROM_ZERO."""
    if transfer == "srgb":
        scale = 1 / (1 + _SRGB_OFFSET)
        curve = cv2.addWeighted(code, scale, code, 0, _SRGB_OFFSET * scale)
        _power_in_place(curve, _SRGB_POWER)
        curved = cv2.compare(code, _SRGB_CODE, cv2.CMP_GT)
        cv2.multiply(code, 1 / _SRGB_SLOPE, dst=code)
        cv2.copyTo(curve, curved, code)
    elif transfer != "linear":
        _power_in_place(code, _gamma(transfer))
        cv2.threshold(code, 10 * _POWER_FLOOR**2, 0, cv2.THRESH_TOZERO, dst=code)


def _power_in_place(values: Float32, exponent: float) -> None:
    """Of positive values, within 2e-6; cv2.pow takes three times as long."""
    cv2.log(values, dst=values)
    values *= np.float32(exponent)
    cv2.exp(values, dst=values)


# ---- tables and buffers ----


@functools.lru_cache(maxsize=16)
def _code_table(bit_depth: int, range_: Range) -> Float32:
    """Nominal 0 to 1 for every value that the plane's integer type can hold (BT.709-6, 4.6)."""
    codes = np.arange(256 if bit_depth == 8 else 65536, dtype=np.float64)
    step = 2.0 ** (bit_depth - 8)
    values = codes / (256 * step - 1) if range_ == "full" else (codes / step - 16) / 219
    return values.astype(np.float32)


@functools.lru_cache(maxsize=16)
def _chroma_table(bit_depth: int, range_: Range) -> Float32:
    """Nominal -0.5 to 0.5 for every code; the middle code is exactly 0."""
    codes = np.arange(256 if bit_depth == 8 else 65536, dtype=np.float64)
    step = 2.0 ** (bit_depth - 8)
    span = 256 * step - 1 if range_ == "full" else 224 * step
    return ((codes - 128 * step) / span).astype(np.float32)


@functools.lru_cache(maxsize=16)
def _linear_table(bit_depth: int, range_: Range, transfer: Transfer, clip: bool) -> Float32:
    code = _code_table(bit_depth, range_).astype(np.float64)
    return eotf(np.clip(code, 0, 1) if clip else code, transfer).astype(np.float32)


def _gamma(transfer: Transfer) -> float:
    if transfer not in _GAMMA:
        raise ValueError(f"{transfer} is not a transfer of SDR")
    return _GAMMA[transfer]


def _colour_planes(frame: Frame) -> tuple[Code, Code, Code]:
    if frame.encoding.family == "grey":
        return (frame.planes[0],) * 3
    return frame.planes[0], frame.planes[1], frame.planes[2]


def _empty_planes(frame: Frame) -> Planes:
    shape = frame.planes[0].shape
    return np.empty(shape, np.float32), np.empty(shape, np.float32), np.empty(shape, np.float32)


def _strips(frame: Frame, planes: Planes) -> Iterator[tuple[slice, Planes]]:
    height = frame.size[1]
    for top in range(0, height, STRIP_ROWS):
        rows = slice(top, min(top + STRIP_ROWS, height))
        yield rows, (planes[0][rows], planes[1][rows], planes[2][rows])


def _padded_width(width: int) -> int:
    return -(-width // _LANES) * _LANES


def _buffers(rows: int, width: int) -> Planes:
    shape = (rows, width)
    return np.empty(shape, np.float32), np.empty(shape, np.float32), np.empty(shape, np.float32)


def _pad(codes: Code, width: int, above: int = 0, below: int = 0) -> Code:
    """Extend the plane with its edges repeated: to `width` columns, and rows above and below."""
    right = width - codes.shape[1]
    if not (right or above or below):
        return codes
    return cast(Code, cv2.copyMakeBorder(codes, above, below, 0, right, cv2.BORDER_REPLICATE))


def _offset(siting: ChromaSiting, *, vertical: bool) -> float:
    """Where a chroma sample lies among the pixels it serves: 0 first, 0.5 midway, 1 last."""
    first, last = ("top", "bottom") if vertical else ("left", "right")
    return 0.0 if first in siting else 1.0 if last in siting else 0.5


def _interpolate(values: Float64, count: int, offset: float) -> Float64:
    """Rows at `count` whole positions, linear between samples, constant outside them."""
    factor = 1
    while values.shape[0] * factor < count:
        factor *= 2
    at = np.clip((np.arange(count) - offset * (factor - 1)) / factor, 0, values.shape[0] - 1)
    below = np.floor(at).astype(np.intp)
    above = np.minimum(below + 1, values.shape[0] - 1)
    part = (at - below)[:, None]
    return np.asarray(values[below] * (1 - part) + values[above] * part, np.float64)


def _white_cone(primaries: str) -> Float64:
    x, y = CHROMATICITIES[primaries][6:]
    return np.asarray(_BRADFORD @ np.array([x / y, 1, (1 - x - y) / y]), np.float64)
