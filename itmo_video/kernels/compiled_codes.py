"""The compiled form of light, or R'G'B', to dithered Y'CbCr codes."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from itmo_video.kernels.compiled import Float32, alike, in_lines

Codes10: TypeAlias = npt.NDArray[np.uint16]
Curve = Literal["pq", "hlg"]

NOISE_TILE = 256  # as in to_codes.c
_CURVES: dict[Curve | None, int] = {None: 0, "pq": 1, "hlg": 2}


class ToCodes(NamedTuple):
    """How R'G'B' becomes Y'CbCr codes.

    `weights` are kr and kb; `halved` tells whether chroma has half the columns, half the rows;
    `luma` and `chroma` are what 1 is worth and the code of 0, `limits` the least and the greatest
    code; `noise_at` (x, y) is where each plane's noise begins in its tile.
    """

    weights: tuple[float, float]
    halved: tuple[bool, bool]
    luma: tuple[float, float]
    chroma: tuple[float, float]
    limits: tuple[float, float]
    noise_at: tuple[tuple[int, int], ...]

    def from_rows(self, rows: Sequence[int]) -> ToCodes:
        """The same for planes from these rows on."""
        moved = tuple((x, y + row) for (x, y), row in zip(self.noise_at, rows, strict=True))
        return self._replace(noise_at=moved)


class OfLight(NamedTuple):
    """How linear light becomes R'G'B': by `matrix` to nits of BT.2020 up to a peak, then a curve.

    `gamma` is HLG's system gamma for the peak. With `factors` nits are first multiplied by that of
    max(R, G, B) as a half float, up to `display_peak`: (65536,), by a half's bits.
    """

    matrix: tuple[float, ...]
    peak_nits: float
    curve: Curve
    gamma: float = 1.0
    factors: Float32 | None = None
    display_peak: float = 0.0


def rgb_to_codes(
    loaded: ctypes.CDLL,
    rgb_code: Sequence[Float32],
    form: ToCodes,
    noise: Float32,
    out: Sequence[Codes10],
) -> None:
    """Write the codes of R'G'B' planes (float32) to `out` (Y', Cb, Cr)."""
    _to_codes(loaded, rgb_code, None, form, noise, out)


def light_to_codes(
    loaded: ctypes.CDLL,
    rgb: Sequence[npt.NDArray[Any]],
    light: OfLight,
    form: ToCodes,
    noise: Float32,
    out: Sequence[Codes10],
) -> tuple[float, float]:
    """Write the codes of linear light (half or float32) to `out`.

    Luma may have a column and a row more than the light, whose last ones are then repeated. Returns
    the peak and the average of max(R, G, B) in nits.
    """
    return _to_codes(loaded, rgb, light, form, noise, out)


def _to_codes(
    loaded: ctypes.CDLL,
    rgb: Sequence[npt.NDArray[Any]],
    light: OfLight | None,
    form: ToCodes,
    noise: Float32,
    out: Sequence[Codes10],
) -> tuple[float, float]:
    planes = [in_lines(plane) for plane in rgb]
    kinds = {plane.dtype for plane in planes}
    if kinds not in ({np.dtype(np.float16)}, {np.dtype(np.float32)}):
        raise TypeError(f"planes are {', '.join(map(str, kinds))}, not all half or all float32")
    (height, width), (rows, columns), (across, down) = planes[0].shape, out[0].shape, form.halved
    alike(*planes)
    alike(*out[1:])
    if not (0 <= rows - height <= 1 and 0 <= columns - width <= 1 and height and width):
        raise ValueError(f"{columns}x{rows} codes for {width}x{height} places")
    if out[1].shape != (rows >> down, columns >> across) or (columns & across) or (rows & down):
        raise ValueError(f"chroma {out[1].shape} beside luma {out[0].shape}")
    if noise.shape != (NOISE_TILE, 2 * NOISE_TILE):
        raise ValueError(f"noise of shape {noise.shape}")
    places = [place % NOISE_TILE for at in form.noise_at for place in at]
    curve, of_light, factors = None, [0.0] * 12, None
    if light is not None:
        curve, gamma, display, factors = light.curve, light.gamma, light.display_peak, light.factors
        of_light = [*light.matrix, light.peak_nits, (1 - gamma) / gamma, display]
    if factors is not None and factors.shape != (65536,):
        raise ValueError(f"factors of shape {factors.shape}")
    sizes = [
        planes[0].itemsize,
        width,
        height,
        columns,
        rows,
        across,
        down,
        _CURVES[curve],
        *places,
    ]
    numbers = [*of_light, *form.weights, *form.luma, *form.chroma, *form.limits]
    seen = np.zeros(2, np.float64)
    loaded.itmo_to_codes(
        *planes, np.array([plane.strides[0] for plane in planes], np.int64),
        np.array(sizes, np.int64), np.array(numbers, np.float32), factors, noise,
        *out,
        seen,
    )  # fmt: skip
    return float(seen[0]), float(seen[1]) / (height * width)
