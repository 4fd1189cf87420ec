"""A frame at analysis size: the luma that guides the map, and a grey picture for cuts and flow."""

from __future__ import annotations

from typing import Any, TypeVar, cast

import cv2
import numpy as np
import numpy.typing as npt

from itmo_video.colour.primaries import LUMINANCE_WEIGHTS_BANTERLE2006
from itmo_video.kernels import compiled_area
from itmo_video.kernels.dispatch import with_compiled_form
from itmo_video.model import Code, Float32, Frame

_ALL = slice(None)


Plane = TypeVar("Plane", Code, Float32)


def analysis_size(width: int, height: int, map_width: int) -> tuple[int, int]:
    """(width, height) of the analysis picture: at most `map_width` wide."""
    if width <= map_width:
        return width, height
    return map_width, max(1, round(height * map_width / width))


def guide_codes(frame: Frame, size: tuple[int, int] | None = None, rows: slice = _ALL) -> Float32:
    """Luma code, 0 black to 1 white, unclipped: float32 (H, W), area-averaged to `size`."""
    encoding = frame.encoding
    black, span = encoding.black_and_span
    count = 3 if encoding.family == "rgb" else 1
    weights = LUMINANCE_WEIGHTS_BANTERLE2006 if count == 3 else (1.0,)
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
    """A plane (H, W) area-averaged to (width, height).

    Halved first as often as possible, which cv2 does 20 times as fast.
    """
    height, width = plane.shape
    small: npt.NDArray[Any] = plane
    while width >= 2 * size[0] and height >= 2 * size[1] and width % 2 == 0 and height % 2 == 0:
        width, height = width // 2, height // 2
        small = cv2.resize(small, (width, height), interpolation=cv2.INTER_AREA)
    return area_means(small, size)


def area_means(planes: Plane, size: tuple[int, int]) -> Plane:
    """Planes (H, W) or (H, W, C) area-averaged to (width, height) in one step."""
    height, width = planes.shape[:2]
    is_larger = width < size[0] or height < size[1]
    if is_larger or not (width % size[0] or height % size[1]):  # or by whole factors
        return cast(Plane, _by_opencv(planes, size))
    return cast(Plane, _area_means(planes, size))


def _by_opencv(planes: npt.NDArray[Any], size: tuple[int, int]) -> npt.NDArray[Any]:
    small = cv2.resize(planes, size, interpolation=cv2.INTER_AREA)
    return np.asarray(small).reshape(*size[::-1], *planes.shape[2:])


_area_means = with_compiled_form(compiled_area.area_means)(_by_opencv)


def analysis_guide(frame: Frame, map_width: int) -> Float32:
    """Luma code at analysis size, clipped to [0, 1]: the guide of the map."""
    return np.clip(guide_codes(frame, analysis_size(*frame.size, map_width)), 0, 1)


def grey_of(guide: Float32) -> Code:
    """The guide as an 8-bit grey picture, for cuts and flow."""
    return np.asarray(np.rint(guide * np.float32(255)), np.uint8)
