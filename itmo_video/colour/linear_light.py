"""Converts a frame's integer codes to linear R, G, B in its own primaries.

Every row of the result is computed from the same operands in the same order whichever strip it is
in, so a strip equals the same rows of the whole picture to the bit.
"""

from __future__ import annotations

import ctypes
import functools
from typing import TypeAlias, cast

import cv2
import numpy as np

from itmo_video.colour.chroma import double_columns, double_rows, siting_offset
from itmo_video.colour.primaries import LUMINANCE_KR_KB
from itmo_video.colour.strips import strip_buffers, strips
from itmo_video.colour.transfer import (
    SRGB_CODE,
    SRGB_OFFSET,
    SRGB_POWER,
    SRGB_SLOPE,
    eotf,
    gamma_of,
)
from itmo_video.kernels import compiled_light
from itmo_video.kernels.dispatch import with_compiled_form
from itmo_video.model import Code, Float32, Frame, Matrix, Range, Transfer

Planes: TypeAlias = tuple[Float32, Float32, Float32]

# Padding widths to this avoids the scalar tail of cv2 calls, whose rounding may differ from that
# of the vector loop and would make a row depend on its strip.
_LANES = 128

# 0 has no logarithm, and the power of this floor is not yet subnormal.
_POWER_FLOOR = 1e-8
_FROM_ZERO = ("linear", "srgb")  # these take no power of a code near 0


def to_rgb_linear(frame: Frame, *, clip: bool) -> Planes:
    """The frame as linear R, G, B in the source's own primaries, SDR white at 1.

    Three float32 planes of the frame's height and width. With `clip` codes are clipped to [0, 1]
    first; without it over-white stays above 1 and negative codes give negative light.
    """
    width, height = frame.size
    red, green, blue = strip_buffers(slice(0, height), width)
    for rows in strips(height):
        strip_to_rgb_linear(frame, rows, clip, (red[rows], green[rows], blue[rows]))
    return red, green, blue


def strip_to_rgb_linear(frame: Frame, rows: slice, clip: bool, out: Planes) -> None:
    """Write the given rows of `to_rgb_linear` into three float32 arrays of (rows, width).

    Any strip has the same rows as the whole frame, to the bit. Raises ValueError if the encoding's
    transfer is PQ or HLG.
    """
    encoding = frame.encoding
    if encoding.family != "ycbcr":
        table = _linear_table(encoding.bit_depth, encoding.range, encoding.transfer, clip)
        for plane, target in zip(_colour_planes(frame), out, strict=True):
            cv2.LUT(plane[rows], table, dst=target)
        return
    _ycbcr_to_linear(frame, rows, clip, out)


def _compiled_halved(loaded: ctypes.CDLL, frame: Frame) -> Planes:
    codes = codes_to_light(frame, True) if frame.encoding.family == "ycbcr" else None
    if codes is None or codes.exponent is None:
        return _halved_in_strips(frame)
    out = _halved_planes(frame)
    compiled_light.halved_light(loaded, frame.planes[:3], codes, out)
    return out


def _halved_planes(frame: Frame) -> Planes:
    red, green, blue = np.empty((3, frame.size[1] // 2, frame.size[0] // 2), np.float32)
    return red, green, blue


def _halved_in_strips(frame: Frame) -> Planes:
    (width, height), out = frame.size, _halved_planes(frame)
    for rows in strips(height):  # even ones
        rgb = strip_buffers(rows, width)
        strip_to_rgb_linear(frame, rows, True, rgb)
        size = (width // 2, (rows.stop - rows.start) // 2)
        for plane, strip in zip(out, rgb, strict=True):
            # While it is in the cache: cv2 gives the same bytes for strips.
            inner = plane[rows.start // 2 : rows.stop // 2]
            cv2.resize(strip, size, dst=inner, interpolation=cv2.INTER_AREA)
    return out


@with_compiled_form(_compiled_halved)
def halved_rgb_linear(frame: Frame) -> Planes:
    """`to_rgb_linear`, clipped and averaged over 2 x 2 pixels: three float32 (H / 2, W / 2).

    The frame's sides are even.
    """
    return _halved_in_strips(frame)


def _compiled_to_linear(
    loaded: ctypes.CDLL, frame: Frame, rows: slice, clip: bool, out: Planes
) -> None:
    codes = codes_to_light(frame, clip)
    compiled_light.ycbcr_rows(loaded, frame.planes[:3], rows, codes, out)
    if codes.exponent is None:
        for target in out:
            _eotf_in_place(target, frame.encoding.transfer, clip)


@with_compiled_form(_compiled_to_linear)
def _ycbcr_to_linear(frame: Frame, rows: slice, clip: bool, out: Planes) -> None:
    width = frame.size[0]
    buffers = out if width % _LANES == 0 else strip_buffers(rows, _padded_width(width))
    _ycbcr_strip(frame, rows, buffers)
    for buffer, target in zip(buffers, out, strict=True):
        _eotf_in_place(buffer, frame.encoding.transfer, clip)
        if target is not buffer:
            np.copyto(target, buffer[:, :width])


def codes_to_light(frame: Frame, clip: bool) -> compiled_light.CodesToLight:
    """How kernels read a Y'CbCr frame: to linear light if that is a power, else to R'G'B'."""
    encoding, (width, height), chroma = frame.encoding, frame.size, frame.planes[1]
    across = None if width <= chroma.shape[1] else siting_offset(encoding.siting, vertical=False)
    down = None if height <= chroma.shape[0] else siting_offset(encoding.siting, vertical=True)
    step = 2.0 ** (encoding.bit_depth - 8)
    chroma_span = 256 * step - 1 if encoding.range == "full" else 224 * step
    return compiled_light.CodesToLight(
        (across, down),
        (*encoding.black_and_span, 128 * step, chroma_span),
        _matrix_factors(encoding.matrix),
        gamma_of(encoding.transfer) if clip and encoding.transfer not in _FROM_ZERO else None,
    )


def _matrix_factors(matrix: Matrix) -> tuple[float, float, float, float]:
    """What Cr adds to red, Cb to blue, Cr to green and Cb to green."""
    kr, kb = LUMINANCE_KR_KB[matrix]
    kg = 1 - kr - kb
    return 2 * (1 - kr), 2 * (1 - kb), -2 * (1 - kr) * kr / kg, -2 * (1 - kb) * kb / kg


def _ycbcr_strip(frame: Frame, rows: slice, out: Planes) -> None:
    """R'G'B' of some rows; `out` has the padded width."""
    encoding, padded = frame.encoding, out[0].shape[1]
    luma_codes, cb_codes, cr_codes = frame.planes[:3]
    cr_red, cb_blue, cr_green, cb_green = _matrix_factors(encoding.matrix)
    red, green, blue = out
    luma = cv2.LUT(_pad(luma_codes[rows], padded), _code_table(encoding.bit_depth, encoding.range))
    cb = _chroma_strip(cb_codes, frame, rows, padded)
    cr = _chroma_strip(cr_codes, frame, rows, padded)
    cv2.scaleAdd(cr, cr_red, luma, dst=red)
    cv2.scaleAdd(cb, cb_blue, luma, dst=blue)
    cv2.scaleAdd(cr, cr_green, luma, dst=green)
    cv2.scaleAdd(cb, cb_green, green, dst=green)


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
        doubled = double_rows(values, siting_offset(siting, vertical=True))
        skip = rows.start - 2 * (first + 1)
        strip = doubled[skip : skip + rows.stop - rows.start]
    return double_columns(strip, siting_offset(siting, vertical=False)) if by_x else strip


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
    """Codes to light in place; codes are at least _POWER_FLOOR, or 0 for those of _FROM_ZERO."""
    if transfer == "srgb":
        scale = 1 / (1 + SRGB_OFFSET)
        curve = cv2.addWeighted(code, scale, code, 0, SRGB_OFFSET * scale)
        _power_in_place(curve, SRGB_POWER)
        curved = cv2.compare(code, SRGB_CODE, cv2.CMP_GT)
        cv2.multiply(code, 1 / SRGB_SLOPE, dst=code)
        cv2.copyTo(curve, curved, code)
    elif transfer != "linear":
        _power_in_place(code, gamma_of(transfer))
        cv2.threshold(code, 10 * _POWER_FLOOR**2, 0, cv2.THRESH_TOZERO, dst=code)


def _power_in_place(values: Float32, exponent: float) -> None:
    """A power of positive values, within 2e-6; cv2.pow takes three times as long."""
    cv2.log(values, dst=values)
    values *= np.float32(exponent)
    cv2.exp(values, dst=values)


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


def _colour_planes(frame: Frame) -> tuple[Code, Code, Code]:
    if frame.encoding.family == "grey":
        return (frame.planes[0],) * 3
    return frame.planes[0], frame.planes[1], frame.planes[2]


def _padded_width(width: int) -> int:
    return -(-width // _LANES) * _LANES


def _pad(codes: Code, width: int, above: int = 0, below: int = 0) -> Code:
    """Extend the plane by repeating its edges: to `width` columns, and rows above and below."""
    right = width - codes.shape[1]
    if not (right or above or below):
        return codes
    return cast(Code, cv2.copyMakeBorder(codes, above, below, 0, right, cv2.BORDER_REPLICATE))
