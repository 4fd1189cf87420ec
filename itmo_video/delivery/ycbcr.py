"""Nonlinear R'G'B' as limited-range Y'CbCr codes, dithered.

Pure: arrays in, arrays out. Planes are (height, width).
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any, Literal, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from itmo_video import reused_memory
from itmo_video.colour.primaries import LUMINANCE_KR_KB
from itmo_video.delivery.choices import Chroma
from itmo_video.kernels import compiled_codes
from itmo_video.kernels.compiled_codes import NOISE_TILE, ToCodes
from itmo_video.kernels.dispatch import with_compiled_form
from itmo_video.model import Float32

Codes10: TypeAlias = npt.NDArray[np.uint16]
YCbCr: TypeAlias = tuple[Codes10, Codes10, Codes10]
Planes: TypeAlias = tuple[Float32, Float32, Float32]


def to_ycbcr(
    rgb_code: Planes,
    matrix: Literal["bt709", "bt2020"],
    chroma: Chroma,
    frame_index: int,
    bit_depth: int = 10,
) -> YCbCr:
    """Nonlinear R'G'B' as limited-range Y'CbCr; subsampled dimensions must be even.

    Chroma is sited left (as in MPEG-2, H.273 type 0) and filtered by 1-2-1 horizontally. Dithered
    before rounding, with noise that depends only on the frame's index and the position. BT.2100-2,
    tables 6 and 9.
    """
    out = empty_codes(rgb_code[0].shape, chroma)
    form = codes_form(matrix, chroma, frame_index, bit_depth)
    write_codes(rgb_code, form, dither_noise(), out)
    return out


def codes_form(
    matrix: Literal["bt709", "bt2020"], chroma: Chroma, frame_index: int, bit_depth: int = 10
) -> ToCodes:
    """How `to_ycbcr` makes codes, for the kernels."""
    step = 2.0 ** (bit_depth - 10)
    return ToCodes(
        LUMINANCE_KR_KB[matrix],
        (chroma != "444", chroma == "420"),
        (876 * step, 64 * step),
        (896 * step, 512 * step),
        # 0 to 3 and 1020 to 1023 are reserved for synchronisation in 10-bit video, 0 and 255 in
        # 8 bits.
        (4 * step, 1019.75 * step // 1),
        # The noise moves from frame to frame, as static noise looks like dirt.
        tuple((frame_index * 97 + plane * 31, frame_index * 57 + plane * 83) for plane in range(3)),
    )


def empty_codes(shape: tuple[int, ...], chroma: Chroma) -> YCbCr:
    """Room for the codes of a picture of this even shape."""
    rows, columns = shape
    chroma_rows = rows // 2 if chroma == "420" else rows
    chroma_columns = columns if chroma == "444" else columns // 2
    # One piece of memory: the system gives large ones in large pages.
    whole = reused_memory.empty((rows * columns + 2 * chroma_rows * chroma_columns,), np.uint16)
    luma, cb, cr = np.split(whole, (rows * columns, rows * columns + chroma_rows * chroma_columns))
    in_planes = (chroma_rows, chroma_columns)
    return luma.reshape(shape), cb.reshape(in_planes), cr.reshape(in_planes)


@functools.lru_cache(maxsize=1)
def dither_noise() -> Float32:
    """Uniform noise of one code's width, which keeps the mean exactly: (tile, two tiles)."""
    tile = np.random.default_rng(20061130).uniform(-0.5, 0.5, (NOISE_TILE, NOISE_TILE))
    return np.tile(tile.astype(np.float32), (1, 2))


@with_compiled_form(compiled_codes.rgb_to_codes)
def write_codes(
    rgb_code: Sequence[Float32], form: ToCodes, noise: Float32, out: Sequence[Codes10]
) -> None:
    """Write the codes of R'G'B' to `out`; `noise` is of (tile, two tiles)."""
    kr, kb = form.weights
    red, green, blue = rgb_code
    luma = cv2.scaleAdd(blue, kb, cv2.addWeighted(red, kr, green, 1 - kr - kb, 0))
    cb = _subsampled(cv2.addWeighted(blue, 0.5 / (1 - kb), luma, -0.5 / (1 - kb), 0), form)
    cr = _subsampled(cv2.addWeighted(red, 0.5 / (1 - kr), luma, -0.5 / (1 - kr), 0), form)
    for number, plane in enumerate((luma, cb, cr)):
        out[number][:] = _quantised(plane, form, number, noise)


def _subsampled(plane: Any, form: ToCodes) -> Any:
    across, down = form.halved
    if down:
        plane = cv2.addWeighted(plane[0::2], 0.5, plane[1::2], 0.5, 0)
    if not across:
        return plane
    around = cv2.copyMakeBorder(plane, 0, 0, 1, 1, cv2.BORDER_REPLICATE)
    sides = cv2.addWeighted(around[:, 0:-2:2], 0.25, around[:, 2::2], 0.25, 0)
    return cv2.scaleAdd(np.ascontiguousarray(plane[:, 0::2]), 0.5, sides)


def _quantised(plane: Any, form: ToCodes, number: int, noise: Float32) -> Codes10:
    scale, offset = form.chroma if number else form.luma
    x, y = (place % NOISE_TILE for place in form.noise_at[number])
    height, width = plane.shape
    tile = np.roll(noise[:, :NOISE_TILE], (-y, -x), (0, 1))
    tiled = np.tile(tile, (-(-height // NOISE_TILE), -(-width // NOISE_TILE)))
    codes = np.asarray(cv2.scaleAdd(plane, scale, tiled[:height, :width]))
    codes += np.float32(offset)
    np.clip(codes, *map(np.float32, form.limits), out=codes)
    return np.asarray(np.rint(codes, out=codes), np.uint16)
