"""Encoding linear HDR to 10-bit PQ or HLG codes, and measuring HDR10's light levels.

Pure: arrays in, arrays out. Planes are (height, width); linear light is in nits (cd/m2).
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias, cast

import cv2
import numpy as np
import numpy.typing as npt

from itmo_video.colour.primaries import LUMINANCE_KR_KB, luminance_weights, rgb_to_rgb_matrix
from itmo_video.colour.transfer import hlg_gamma, hlg_oetf, pq_code
from itmo_video.model import Float32, Half

Curve = Literal["pq", "hlg"]
Chroma = Literal["420", "422", "444"]
Codes10: TypeAlias = npt.NDArray[np.uint16]
YCbCr: TypeAlias = tuple[Codes10, Codes10, Codes10]
Planes: TypeAlias = tuple[Float32, Float32, Float32]

# cv2.pow is 20 times slower at 0
_POWER_FLOOR = 1e-12
_NOISE_TILE = 256
_STRIP_ROWS = 32  # even; a strip's planes fit into a core's L2 cache: 3 times faster


@dataclass(frozen=True)
class Light:
    """Light levels in nits: the peak and the average of max(R, G, B) of one frame or a film.

    For a film, `peak` is MaxCLL and `average` is MaxFALL (CTA-861.3, annex P).
    """

    peak: float
    average: float

    @property
    def as_integers(self) -> tuple[int, int]:
        """(MaxCLL, MaxFALL) as metadata stores them: whole nits, 1 to 65535 (0 means unknown)."""
        cll, fall = (min(max(round(value), 1), 65535) for value in (self.peak, self.average))
        return cll, fall


def film_light(frames: Iterable[Light]) -> Light:
    """MaxCLL and MaxFALL of a film from its frames' light; zeros without frames."""
    peak = average = 0.0
    for light in frames:
        peak, average = max(peak, light.peak), max(average, light.average)
    return Light(peak, average)


def frame_light(nits: Planes) -> Light:
    """The light levels of one frame from its R, G, B in nits (CTA-861.3)."""
    largest = cv2.max(cv2.max(nits[0], nits[1]), nits[2])
    return Light(float(cv2.minMaxLoc(largest)[1]), float(cv2.mean(largest)[0]))


def to_nits_2020(
    rgb: Sequence[Half | Float32], primaries: str, white_nits: float, peak_nits: float
) -> Planes:
    """Linear RGB, 1.0 = `white_nits`, as BT.2020 R, G, B in nits, clamped to [0, `peak_nits`].

    `primaries` are names of colour.CHROMATICITIES; three float32 planes of the input's shape.
    """
    planes = [cv2.subtract(plane, 0.0, dtype=cv2.CV_32F) for plane in rgb]  # the fastest way
    matrix = rgb_to_rgb_matrix(primaries, "rec2020") * white_nits
    out = []
    for red, green, blue in matrix.tolist():
        mixed = cv2.addWeighted(planes[0], red, planes[1], green, 0)
        mixed = cv2.scaleAdd(planes[2], blue, mixed)
        out.append(_shaped(cv2.min(cv2.max(mixed, 0.0), peak_nits), planes[0].shape))
    return out[0], out[1], out[2]


def encode_nits(nits: Planes, curve: Curve, peak_nits: float) -> Planes:
    """BT.2020 R, G, B in nits as nonlinear R'G'B', 0 to 1; `peak_nits` affects HLG only.

    For speed, the curve is looked up by the bits of a half float, which is 20 times finer than a
    10-bit PQ step.
    """
    if curve == "hlg":
        nits = _hlg_scene(nits, peak_nits)
    return _three([encode_plane(plane, curve) for plane in nits], nits[0].shape)


def encode_plane(light: Float32, curve: Curve) -> Float32:
    """Look up the curve: PQ for nits, HLG's OETF for scene light from 0 to 1."""
    return _shaped(cv2.LUT(_half_bits(light), _curve_table(curve)), light.shape)


def to_ycbcr(
    rgb_code: Planes,
    matrix: Literal["bt709", "bt2020"],
    chroma: Chroma,
    frame_index: int,
    first_row: int = 0,
    bit_depth: int = 10,
) -> YCbCr:
    """Nonlinear R'G'B' as limited-range Y'CbCr; subsampled dimensions must be even.

    Chroma is sited left (as in MPEG-2, H.273 type 0) and filtered by 1-2-1 horizontally. Dithered
    before rounding, with noise that depends only on the frame's index and the position. A strip
    that starts at an even `first_row` gives the same rows as the whole frame. BT.2100-2, tables 6
    and 9.
    """
    kr, kb = LUMINANCE_KR_KB[matrix]
    red, green, blue = rgb_code
    chroma_row = first_row // 2 if chroma == "420" else first_row
    luma = cv2.scaleAdd(blue, kb, cv2.addWeighted(red, kr, green, 1 - kr - kb, 0))
    cb = _subsampled(cv2.addWeighted(blue, 0.5 / (1 - kb), luma, -0.5 / (1 - kb), 0), chroma)
    cr = _subsampled(cv2.addWeighted(red, 0.5 / (1 - kr), luma, -0.5 / (1 - kr), 0), chroma)
    return (
        _quantised(luma, 876, 64, frame_index, 0, first_row, bit_depth),
        _quantised(cb, 896, 512, frame_index, 1, chroma_row, bit_depth),
        _quantised(cr, 896, 512, frame_index, 2, chroma_row, bit_depth),
    )


def master_frame(
    rgb: Sequence[Half | Float32],
    primaries: str,
    white_nits: float,
    peak_nits: float,
    curve: Curve,
    chroma: Chroma,
    frame_index: int,
    shown: Callable[[Planes], Planes] = lambda nits: nits,
) -> tuple[YCbCr, Light]:
    """Codes and light of one frame: `to_nits_2020`, `frame_light`, `encode_nits`, `to_ycbcr`.

    Equivalent to these four on the whole frame, but done in strips; odd sizes are padded to even
    ones. `shown` is applied to the nits first, pixel by pixel.
    """
    height, width = rgb[0].shape
    padded: tuple[Any, ...] = pad_even(rgb)
    rows, columns = padded[0].shape
    chroma_shape = (
        rows // 2 if chroma == "420" else rows, columns if chroma == "444" else columns // 2
    )  # fmt: skip
    out = tuple(np.empty(s, np.uint16) for s in ((rows, columns), chroma_shape, chroma_shape))
    peak = total = 0.0
    for top in range(0, rows, _STRIP_ROWS):
        strip = [plane[top : top + _STRIP_ROWS] for plane in padded]
        nits = shown(to_nits_2020(strip, primaries, white_nits, peak_nits))
        inside = (nits[0][: height - top, :width], nits[1][: height - top, :width],
                  nits[2][: height - top, :width])  # fmt: skip
        light = frame_light(inside)
        peak, total = max(peak, light.peak), total + light.average * inside[0].shape[0]
        codes = to_ycbcr(encode_nits(nits, curve, peak_nits), "bt2020", chroma, frame_index, top)
        for target, strip_codes in zip(out, codes, strict=True):
            at = top * target.shape[0] // rows
            target[at : at + strip_codes.shape[0]] = strip_codes
    return (out[0], out[1], out[2]), Light(peak, total / height)


def pad_even(planes: Sequence[Any], *, rows: bool = True) -> Any:
    """The planes with their last column (row) repeated if the width (height) is odd."""
    height, width = planes[0].shape
    down, right = height % 2 if rows else 0, width % 2
    if not (down or right):
        return tuple(planes)
    return tuple(
        cv2.copyMakeBorder(plane, 0, down, 0, right, cv2.BORDER_REPLICATE) for plane in planes
    )


def _hlg_scene(nits: Planes, peak_nits: float) -> Planes:
    """Display light to scene light, 0 to 1: BT.2100's inverse OOTF, without black lift."""
    r, g, b = luminance_weights("rec2020")
    y = cv2.scaleAdd(nits[2], b, cv2.addWeighted(nits[0], r, nits[1], g, 0))
    y = cv2.max(cv2.multiply(y, 1 / peak_nits), _POWER_FLOOR)
    gamma = hlg_gamma(peak_nits)
    scale = cv2.multiply(cv2.pow(y, (1 - gamma) / gamma), 1 / peak_nits)
    return _three([cv2.min(cv2.multiply(plane, scale), 1.0) for plane in nits], nits[0].shape)


def _half_bits(plane: Float32) -> npt.NDArray[np.uint16]:
    half = cv2.subtract(plane, 0.0, dtype=cv2.CV_16F).reshape(plane.shape)
    return cast(npt.NDArray[np.uint16], half.view(np.uint16))


@functools.lru_cache(maxsize=2)
def _curve_table(curve: Curve) -> Float32:
    """The curve for all 65536 bit patterns of a half float; negative ones and NaN give 0."""
    halves = np.arange(65536, dtype=np.uint16).view(np.float16)
    values = np.nan_to_num(halves.astype(np.float64), nan=0.0, posinf=65504.0, neginf=0.0)
    code = pq_code(values) if curve == "pq" else hlg_oetf(values)
    code[32768:] = code[0]
    return code.astype(np.float32)


def _subsampled(plane: Any, chroma: Chroma) -> Any:
    if chroma == "444":
        return plane
    if chroma == "420":
        plane = cv2.addWeighted(plane[0::2], 0.5, plane[1::2], 0.5, 0)
    around = cv2.copyMakeBorder(plane, 0, 0, 1, 1, cv2.BORDER_REPLICATE)
    sides = cv2.addWeighted(around[:, 0:-2:2], 0.25, around[:, 2::2], 0.25, 0)
    return cv2.scaleAdd(np.ascontiguousarray(plane[:, 0::2]), 0.5, sides)


def _quantised(
    plane: Any, scale: float, offset: float, index: int, salt: int, row: int, bit_depth: int
) -> Codes10:
    """Dithered codes; `scale` and `offset` are for 10 bits."""
    step = 2.0 ** (bit_depth - 10)
    height, width = plane.shape
    noise = _noise(-(-height // _NOISE_TILE), -(-width // _NOISE_TILE))
    # The noise moves from frame to frame, as static noise looks like dirt.
    x = (index * 97 + salt * 31) % _NOISE_TILE
    y = (index * 57 + salt * 83 + row) % _NOISE_TILE
    window = noise[y : y + height, x : x + width]
    codes = np.asarray(cv2.scaleAdd(plane, scale * step, window))
    codes += np.float32(offset * step)
    # 0 to 3 and 1020 to 1023 are reserved for synchronisation in 10-bit video, 0 and 255 in 8 bits.
    np.clip(codes, np.float32(4 * step), np.float32(1019.75 * step) // 1, out=codes)
    return np.asarray(np.rint(codes, out=codes), np.uint16)


@functools.lru_cache(maxsize=4)
def _noise(rows: int, columns: int) -> Float32:
    """Uniform noise of one code's width, which keeps the mean exactly; one extra tile each way."""
    tile = np.random.default_rng(20061130).uniform(-0.5, 0.5, (_NOISE_TILE, _NOISE_TILE))
    return np.tile(tile.astype(np.float32), (rows + 1, columns + 1))


def _shaped(plane: Any, shape: tuple[int, ...]) -> Float32:
    return cast(Float32, np.asarray(plane, np.float32).reshape(shape))


def _three(planes: Sequence[Any], shape: tuple[int, ...]) -> Planes:
    red, green, blue = (_shaped(plane, shape) for plane in planes)
    return red, green, blue
