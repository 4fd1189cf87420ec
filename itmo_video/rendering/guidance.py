"""Guided by the picture's luma: maps at full size, and a luminance without grain.

Both are guided filters (He and Sun 2015) whose coefficients are computed at analysis size and
upsampled a strip of rows at a time, so any strip has the same bytes as the whole frame.
"""

from __future__ import annotations

import ctypes

import cv2
import numpy as np

from itmo_video.colour.analysis_picture import guide_codes
from itmo_video.colour.transfer import BT1886_GAMMA
from itmo_video.expand_map import density
from itmo_video.kernels import compiled, compiled_auto
from itmo_video.kernels.dispatch import with_compiled_form
from itmo_video.model import Code, Float32, Frame
from itmo_video.operators.base import GRAIN, Guard
from itmo_video.rendering import guided_upsampling
from itmo_video.settings import Settings

EDGE_EPSILON = 1e-3  # contrasts (squared, of codes 0..1) below this do not affect the map
SOFTENING = np.array([1, 4, 6, 4, 1], np.float32) / 16  # binomial, a standard deviation of 1 px
REACH = len(SOFTENING) // 2


def strip_codes(frame: Frame, rows: slice, wrap_x: bool) -> tuple[Float32, Float32]:
    """Luma codes of some rows, as `guide_codes`, and the same softened to guide the map.

    A map that followed each pixel and its grain would change wherever the picture moves by a
    fraction of a pixel. With `wrap_x` (panoramas) the left and right edges join.
    """
    around = _around(rows, frame.size[1])
    codes = guide_codes(frame, rows=around)
    wide = np.pad(codes, ((0, 0), (REACH, REACH)), "wrap") if wrap_x else codes
    soft = cv2.sepFilter2D(wide, -1, SOFTENING, SOFTENING, borderType=cv2.BORDER_REPLICATE)
    if wrap_x:
        soft = soft[:, REACH:-REACH]
    inner = slice(rows.start - around.start, rows.stop - around.start)
    return codes[inner], np.asarray(soft.reshape(codes.shape)[inner], np.float32)


def _around(rows: slice, height: int) -> slice:
    """The rows needed to soften these."""
    return slice(max(0, rows.start - REACH), min(height, rows.stop + REACH))


class Guidance:
    """A frame's maps and noise guard, a strip of rows at a time.

    The noise guard keeps grain, banding and block edges out of the curve's argument. The picture
    keeps its detail: contrasts below the guard's epsilon are not amplified by the curve's slope.
    """

    def __init__(
        self,
        frame: Frame,
        guide: Float32,
        settings: Settings,
        map_small: Float32 | None,
        edge_aware: bool,
        guard: Guard = GRAIN,
    ) -> None:
        """`guide` is its `analysis_guide`; `map_small` (H, W), or (H, W, C) for one per channel."""
        self._frame = frame
        self._wraps = settings.projection == "latlong"
        self._edge_aware = edge_aware and map_small is not None
        self._plainly = self._wraps or not (settings.noise_guard or self._edge_aware)
        self._guards = settings.noise_guard and _has_curve(map_small, guard)
        self._codes: Float32 | None = None
        self._subsets: dict[tuple[int, ...], Float32] = {}  # without the maps that are 0
        small: list[Float32] = []
        if self._guards:
            a, b = guided_upsampling.edge_aware_coefficients(
                guide, guide, guard.radius_px, guard.epsilon
            )
            small += [(a - np.float32(1)) * np.float32(BT1886_GAMMA), b * np.float32(BT1886_GAMMA)]
        if map_small is not None:
            maps = [map_small] if map_small.ndim == 2 else list(cv2.split(map_small))
            for one in maps:
                small += self._coefficients(one, guide, settings.radius) if edge_aware else [one]
        self._small = np.stack(small) if small else None

    def _coefficients(
        self, map_small: Float32, guide: Float32, radius: float
    ) -> tuple[Float32, Float32]:
        height, width = map_small.shape
        radius_px = max(1, round(density.scaled_radius_px(radius, width, height)))
        pad = min(2 * radius_px, width) if self._wraps else 0
        map_around = np.pad(map_small, ((0, 0), (pad, pad)), "wrap")
        guide_around = np.pad(guide, ((0, 0), (pad, pad)), "wrap")
        a, b = guided_upsampling.edge_aware_coefficients(
            map_around, guide_around, radius_px, EDGE_EPSILON
        )
        return a[:, pad : pad + width], b[:, pad : pad + width]

    def rows(self, rows: slice) -> tuple[list[Float32], Float32 | None]:
        """The maps of some rows in [0, 1], and smoothed over given luminance in [0.5, 2].

        Float32 (rows, W) each; no maps, and None, if none are wanted. A map that is 0 in all of
        these rows is a single 0 with strides of 0, which costs nothing. The guard works on codes,
        where noise is uniform; to first order, a relative change of code changes luminance by
        BT.1886's gamma times as much.
        """
        small = self._small
        if small is None:
            return [], None
        zeros: tuple[int, ...] = ()
        if not self._edge_aware:
            small, zeros = self._without_zeros(small, rows)
        maps: list[Float32] = []
        ratio = None
        if len(small):
            maps, ratio = (self.rows_plainly if self._plainly else self._guided)(rows, small)
        shape = rows.stop - rows.start, self._frame.size[0]
        for number in zeros:
            maps.insert(number, np.broadcast_to(np.float32(0), shape))
        return maps, ratio

    def small_maps(self, rows: slice) -> compiled_auto.SmallMaps | None:
        """The input of `rows`, for a kernel that upsamples four maps itself; None if it cannot.

        It cannot for RGB and grey, for panoramas, for maps that follow the picture's edges, or for
        another number of maps (but none).
        """
        small = self._small
        if self._plainly or self._edge_aware or self._frame.encoding.family != "ycbcr":
            return None
        if small is None:
            small = np.zeros((0, 1, 1), np.float32)
        guards = 2 * self._guards
        known = len(small) - guards
        if known not in (0, 4):
            return None
        small, zeros = self._without_zeros(small, rows)
        above, _, part, _ = guided_upsampling.rows_between(
            rows.start, rows.stop, small.shape[1], self._frame.size[1]
        )
        left = iter(range(guards, len(small)))
        a, b, c, d = (-1 if m >= known or m in zeros else next(left) for m in range(4))
        used = np.asarray(small.max(axis=2) > 0, np.uint8)  # maps are at least 0
        numbers = a, b, c, d
        return compiled_auto.SmallMaps(small, used, self._guards, numbers, known > 0, above, part)

    def _without_zeros(self, small: Float32, rows: slice) -> tuple[Float32, tuple[int, ...]]:
        """The planes that are not 0 in these rows, and the numbers of the maps that are."""
        guards = 2 * self._guards
        above, below, _, _ = guided_upsampling.rows_between(
            rows.start, rows.stop, small.shape[1], self._frame.size[1]
        )
        seen = small[guards:, above[0] : below[-1] + 1]
        zeros = tuple(plane for plane, part in enumerate(seen) if not cv2.hasNonZero(part))
        if not zeros:
            return small, ()
        if zeros not in self._subsets:
            left_out = [guards + plane for plane in zeros]
            self._subsets[zeros] = np.delete(small, left_out, axis=0)
        return self._subsets[zeros], zeros

    def _guided(self, rows: slice, small: Float32) -> tuple[list[Float32], Float32 | None]:
        return _guided_rows(self, rows, small)

    def rows_plainly(self, rows: slice, small: Float32) -> tuple[list[Float32], Float32 | None]:
        """`rows` by NumPy and OpenCV, of all planes of `small`."""
        width, height = self._frame.size
        full = list(guided_upsampling.upsample_rows(small, rows, (height, width), self._wraps))
        if not self._guards and not self._edge_aware:
            return full, None
        codes, soft = strip_codes(self._frame, rows, self._wraps)
        ratio = None
        if self._guards:
            ratio, offset = full.pop(0), full.pop(0)
            ratio *= codes
            ratio += offset
            ratio /= np.clip(codes, 0.02, np.inf, out=codes)  # three times as fast as np.maximum
            np.clip(ratio, -0.5, 1, out=ratio)
            ratio += np.float32(1)
        if not self._edge_aware:
            return full, ratio
        for a, b in zip(full[::2], full[1::2], strict=True):
            a *= soft
            a += b
            np.clip(a, 0, 1, out=a)
        return full[::2], ratio

    def rows_compiled(
        self, loaded: ctypes.CDLL, rows: slice, small: Float32
    ) -> tuple[list[Float32], Float32 | None]:
        """`rows_plainly` by the compiled library; not for panoramas, whose edges join."""
        above, _, part, _ = guided_upsampling.rows_between(
            rows.start, rows.stop, small.shape[1], self._frame.size[1]
        )
        return compiled.guide_rows(
            loaded,
            *self._luma(),
            rows,
            small,
            (above, part),
            guards=self._guards,
            edge_aware=self._edge_aware,
        )

    def _luma(self) -> tuple[Code | Float32, tuple[float, float]]:
        """The picture's luma in codes, with the codes of black and of white above it."""
        if self._frame.encoding.family != "rgb":
            return self._frame.planes[0], self._frame.encoding.black_and_span
        if self._codes is None:
            self._codes = guide_codes(self._frame)
        return self._codes, (0.0, 1.0)


def _has_curve(map_small: Float32 | None, guard: Guard) -> bool:
    """Whether there is a curve with a smoothed argument that no map of 0 disables."""
    if map_small is None or map_small.ndim == 2 or guard.curve_map is None:
        return True
    return bool(map_small[..., guard.curve_map].any())


def _compiled_rows(
    loaded: ctypes.CDLL, guidance: Guidance, rows: slice, small: Float32
) -> tuple[list[Float32], Float32 | None]:
    return guidance.rows_compiled(loaded, rows, small)


@with_compiled_form(_compiled_rows)
def _guided_rows(
    guidance: Guidance, rows: slice, small: Float32
) -> tuple[list[Float32], Float32 | None]:
    return guidance.rows_plainly(rows, small)
