"""Encoding linear HDR to 10-bit PQ or HLG codes, and measuring HDR10's light levels.

Pure: arrays in, arrays out. Planes are (height, width); linear light is in nits (cd/m2).
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from itmo_video.colour.primaries import luminance_weights, rgb_to_rgb_matrix
from itmo_video.colour.transfer import hlg_gamma, hlg_oetf, pq_code
from itmo_video.delivery.choices import Chroma
from itmo_video.delivery.eetf import display_factors, times_factors
from itmo_video.delivery.half_tables import all_halves, looked_up, shaped
from itmo_video.delivery.ycbcr import (
    Codes10,
    Planes,
    YCbCr,
    codes_form,
    dither_noise,
    empty_codes,
    write_codes,
)
from itmo_video.kernels import compiled_codes
from itmo_video.kernels.compiled_codes import Curve, OfLight, ToCodes
from itmo_video.kernels.dispatch import with_compiled_form
from itmo_video.model import Float32, Half

# cv2.pow is 20 times slower at 0
_POWER_FLOOR = 1e-12
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
    matrix = rgb_to_rgb_matrix(primaries, "rec2020") * white_nits
    return _to_nits(rgb, matrix.ravel().tolist(), peak_nits)


def _to_nits(rgb: Sequence[Half | Float32], matrix: Sequence[float], peak_nits: float) -> Planes:
    planes = [cv2.subtract(plane, 0.0, dtype=cv2.CV_32F) for plane in rgb]  # the fastest way
    out = []
    for red, green, blue in (matrix[0:3], matrix[3:6], matrix[6:9]):
        mixed = cv2.addWeighted(planes[0], red, planes[1], green, 0)
        mixed = cv2.scaleAdd(planes[2], blue, mixed)
        out.append(shaped(cv2.min(cv2.max(mixed, 0.0), peak_nits), planes[0].shape))
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
    return looked_up(light, _curve_table(curve))


def master_frame(
    rgb: Sequence[Half | Float32],
    primaries: str,
    white_nits: float,
    peak_nits: float,
    curve: Curve,
    chroma: Chroma,
    frame_index: int,
    display_peak: float | None = None,
) -> tuple[YCbCr, Light]:
    """Codes and light of one frame: `to_nits_2020`, `frame_light`, `encode_nits`, `to_ycbcr`.

    Equivalent to these four on the whole frame, but in one pass or in strips; odd sizes are padded
    to even ones. With a `display_peak` after the first, eetf.to_display (PQ only).
    """
    height, width = rgb[0].shape
    out = empty_codes((height + height % 2, width + width % 2), chroma)
    light = OfLight(
        tuple((rgb_to_rgb_matrix(primaries, "rec2020") * white_nits).ravel().tolist()),
        peak_nits, curve, hlg_gamma(peak_nits),
    )  # fmt: skip
    if display_peak is not None and display_peak < peak_nits:
        factors = display_factors(peak_nits, display_peak)
        light = light._replace(factors=factors, display_peak=display_peak)
    form = codes_form("bt2020", chroma, frame_index)
    return out, Light(*light_to_codes(rgb, light, form, dither_noise(), out))


@with_compiled_form(compiled_codes.light_to_codes)
def light_to_codes(
    rgb: Sequence[Half | Float32],
    light: OfLight,
    form: ToCodes,
    noise: Float32,
    out: Sequence[Codes10],
) -> tuple[float, float]:
    """Write the codes of linear light to `out`; peak and average of max(R, G, B) in nits."""
    height, width = rgb[0].shape
    padded: tuple[Any, ...] = pad_even(rgb)
    rows = padded[0].shape[0]
    peak = total = 0.0
    for top in range(0, rows, _STRIP_ROWS):
        strip = [plane[top : top + _STRIP_ROWS] for plane in padded]
        nits = _to_nits(strip, light.matrix, light.peak_nits)
        if light.factors is not None:
            nits = times_factors(nits, light.factors, light.display_peak)
        inside = (nits[0][: height - top, :width], nits[1][: height - top, :width],
                  nits[2][: height - top, :width])  # fmt: skip
        seen = frame_light(inside)
        peak, total = max(peak, seen.peak), total + seen.average * inside[0].shape[0]
        code = encode_nits(nits, light.curve, light.peak_nits)
        starts = [top * plane.shape[0] // rows for plane in out]
        strips = [
            plane[at : at + _STRIP_ROWS * plane.shape[0] // rows]
            for plane, at in zip(out, starts, strict=True)
        ]
        write_codes(code, form.from_rows(starts), noise, strips)
    return peak, total / height


def pad_even(planes: Sequence[Any]) -> Any:
    """The planes with their last column (row) repeated if the width (height) is odd."""
    height, width = planes[0].shape
    down, right = height % 2, width % 2
    if not (down or right):
        return tuple(planes)
    return tuple(
        cv2.copyMakeBorder(plane, 0, down, 0, right, cv2.BORDER_REPLICATE) for plane in planes
    )


def _hlg_scene(nits: Planes, peak_nits: float) -> Planes:
    """Display light to scene light, 0 to 1: BT.2100's inverse OOTF, without black lift."""
    r, g, b = luminance_weights("rec2020")
    y = cv2.scaleAdd(nits[2], b, cv2.addWeighted(nits[0], r, nits[1], g, 0))
    y = cv2.max(y * np.float32(1 / peak_nits), _POWER_FLOOR)  # OpenCV takes 4x1 for a scalar
    gamma = hlg_gamma(peak_nits)
    scale = cv2.pow(y, (1 - gamma) / gamma) * np.float32(1 / peak_nits)
    return _three([cv2.min(cv2.multiply(plane, scale), 1.0) for plane in nits], nits[0].shape)


@functools.lru_cache(maxsize=2)
def _curve_table(curve: Curve) -> Float32:
    """The curve for all 65536 bit patterns of a half float; negative ones and NaN give 0."""
    values = np.nan_to_num(all_halves(), nan=0.0, posinf=65504.0, neginf=0.0)
    code = pq_code(values) if curve == "pq" else hlg_oetf(values)
    code[32768:] = code[0]
    return code.astype(np.float32)


def _three(planes: Sequence[Any], shape: tuple[int, ...]) -> Planes:
    red, green, blue = (shaped(plane, shape) for plane in planes)
    return red, green, blue
