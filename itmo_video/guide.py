"""What a picture's own luma guides: the map at full size, and a luminance free of grain.

Both are guided filters (He and Sun 2015) whose coefficients are found at analysis size and brought
up a strip of rows at a time, so any strip gives the bytes of the whole frame.
"""

from __future__ import annotations

from typing import Any, TypeVar, cast

import cv2
import numpy as np
import numpy.typing as npt

from itmo_video import expand_map, upsampling
from itmo_video.model import Code, Float32, Frame
from itmo_video.operators import LUMINANCE_WEIGHTS
from itmo_video.settings import Settings

EDGE_EPSILON = 1e-3  # contrasts (squared, of codes 0..1) below this do not bend the map
SOFTENING = np.array([1, 4, 6, 4, 1], np.float32) / 16  # binomial, a standard deviation of 1 px
GRAIN_EPSILON = 4e-4  # contrasts below this, 2 % of the code range, count as grain
GRAIN_RADIUS_PX = 3  # at analysis size
GAMMA = 2.4  # how luminance goes with the code, for small differences
_ALL = slice(None)
Plane = TypeVar("Plane", Code, Float32)


def analysis_size(width: int, height: int, map_width: int) -> tuple[int, int]:
    """(width, height) of the picture that map and flow are made at: at most `map_width` wide."""
    if width <= map_width:
        return width, height
    return map_width, max(1, round(height * map_width / width))


def guide_codes(frame: Frame, size: tuple[int, int] | None = None, rows: slice = _ALL) -> Float32:
    """Luma code, 0 black to 1 white, unclipped: float32 (H, W), area-averaged to `size`."""
    encoding = frame.encoding
    black, span = encoding.black_and_span
    count = 3 if encoding.family == "rgb" else 1
    weights = LUMINANCE_WEIGHTS if count == 3 else (1.0,)
    total: Float32 | None = None
    for plane, weight in zip(frame.planes[0:count], weights, strict=True):
        codes = plane[rows]
        if size is not None and (codes.shape[1], codes.shape[0]) != size:
            codes = averaged(codes, size)
        part = cv2.addWeighted(
            codes, weight / span, codes, 0, -black * weight / span, dtype=cv2.CV_32F
        )
        total = part if total is None else cv2.add(total, part)
    assert total is not None
    return np.asarray(total, np.float32).reshape(total.shape[:2])


def averaged(plane: Plane, size: tuple[int, int]) -> Plane:
    """A plane (H, W) averaged over areas to (width, height).

    First halved while that goes, which cv2 does 20 times as fast.
    """
    height, width = plane.shape
    small: npt.NDArray[Any] = plane
    while width >= 2 * size[0] and height >= 2 * size[1] and width % 2 == 0 and height % 2 == 0:
        width, height = width // 2, height // 2
        small = cv2.resize(small, (width, height), interpolation=cv2.INTER_AREA)
    small = cv2.resize(small, size, interpolation=cv2.INTER_AREA)
    return cast(Plane, small.reshape(size[1], size[0]))


def analysis_guide(frame: Frame, map_width: int) -> Float32:
    """Luma code at analysis size, limited to [0, 1]: what guides the map."""
    return np.clip(guide_codes(frame, analysis_size(*frame.size, map_width)), 0, 1)


def strip_codes(frame: Frame, rows: slice, wrap_x: bool) -> tuple[Float32, Float32]:
    """Luma codes of some rows, as `guide_codes`, and the same softened to guide the map.

    A map that follows the picture's last pixel and its grain changes wherever the picture moves by
    part of a pixel. With `wrap_x` (panoramas) the left and right edges meet.
    """
    reach = len(SOFTENING) // 2
    around = slice(max(0, rows.start - reach), min(frame.size[1], rows.stop + reach))
    codes = guide_codes(frame, rows=around)
    wide = np.pad(codes, ((0, 0), (reach, reach)), "wrap") if wrap_x else codes
    soft = cv2.sepFilter2D(wide, -1, SOFTENING, SOFTENING, borderType=cv2.BORDER_REPLICATE)
    if wrap_x:
        soft = soft[:, reach:-reach]
    inner = slice(rows.start - around.start, rows.stop - around.start)
    return codes[inner], np.asarray(soft.reshape(codes.shape)[inner], np.float32)


def grey_of(guide: Float32) -> Code:
    """8-bit grey picture of a guide, for cuts and flow."""
    return np.asarray(np.rint(guide * np.float32(255)), np.uint8)


class FullMap:
    """Maps at analysis size, brought up to the frame's size a strip of rows at a time."""

    def __init__(
        self,
        map_small: Float32,
        frame: Frame,
        guide: Float32,
        settings: Settings,
        edge_aware: bool,
    ) -> None:
        """`map_small` is (H, W), or (H, W, C) for one of each channel."""
        self._frame = frame
        self._wraps = settings.projection == "latlong"
        self._edge_aware = edge_aware
        maps = [map_small] if map_small.ndim == 2 else list(cv2.split(map_small))
        if edge_aware:
            maps = [
                part for one in maps for part in self._coefficients(one, guide, settings.radius)
            ]
        self._small = np.stack(maps)

    def _coefficients(
        self, map_small: Float32, guide: Float32, radius: float
    ) -> tuple[Float32, Float32]:
        height, width = map_small.shape
        radius_px = max(1, round(expand_map.scaled_radius_px(radius, width, height)))
        pad = min(2 * radius_px, width) if self._wraps else 0
        map_around = np.pad(map_small, ((0, 0), (pad, pad)), "wrap")
        guide_around = np.pad(guide, ((0, 0), (pad, pad)), "wrap")
        a, b = upsampling.edge_aware_coefficients(map_around, guide_around, radius_px, EDGE_EPSILON)
        return a[:, pad : pad + width], b[:, pad : pad + width]

    def rows(self, rows: slice, codes: Float32 | None) -> list[Float32]:
        """Rows of the maps at full size, float32 in [0, 1]; `codes` are the rows' soft codes."""
        width, height = self._frame.size
        full = list(upsampling.upsample_rows(self._small, rows, (height, width), self._wraps))
        if not self._edge_aware:
            return full
        assert codes is not None
        for a, b in zip(full[::2], full[1::2], strict=True):
            a *= codes
            a += b
            np.clip(a, 0, 1, out=a)
        return full[::2]


class NoiseGuard:
    """Luminance for the curve's argument, without grain, banding and block edges.

    The picture keeps its own detail: only the gain is found from the smoothed luminance, so what
    is below GRAIN_EPSILON is carried through as it is and not lifted by the curve's slope.
    """

    def __init__(self, frame: Frame, guide: Float32) -> None:
        self._frame = frame
        coefficients = upsampling.edge_aware_coefficients(
            guide, guide, GRAIN_RADIUS_PX, GRAIN_EPSILON
        )
        self._small = np.stack(coefficients)

    def ratio(self, rows: slice, codes: Float32) -> Float32:
        """Smoothed over given luminance of some rows, (rows, W) in [0.5, 2].

        The filter works on codes, where noise is even; to first order a change of code by a
        fraction changes luminance by GAMMA times that fraction.
        """
        width, height = self._frame.size
        ratio, offset = upsampling.upsample_rows(self._small, rows, (height, width))
        ratio -= np.float32(1)
        ratio *= codes
        ratio += offset
        ratio *= np.float32(GAMMA)
        ratio /= np.clip(codes, 0.02, np.inf)  # three times as fast as np.maximum
        np.clip(ratio, -0.5, 1, out=ratio)
        ratio += np.float32(1)
        return np.asarray(ratio, np.float32)
