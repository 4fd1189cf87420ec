"""Letterbox and pillarbox bars, detected in a single picture, as the law requires."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from itmo_video.model import Float32

BLACK = 1e-4  # linear luminance: five 8-bit codes above black under BT.1886
LEAST_SHARE = 0.02  # of the height or width: anything thinner is an edge, not a bar
MOST_SHARE = 0.6  # of both bars together: above it, the picture is dark rather than letterboxed


class Bars(NamedTuple):
    """Pixels of bar at each edge."""

    top: int
    bottom: int
    left: int
    right: int


def find_bars(luminance: Float32) -> Bars:
    """The bars of a linear luminance picture (H, W) in [0, 1]; zeros if there are none.

    A pair of bars is entirely black, of equal size on both sides, and borders on rows (columns)
    that are mostly not black, unlike a dark scene or lamps at night.
    """
    content = luminance > BLACK
    top, bottom = _pair(content)
    inner = content[top : content.shape[0] - bottom]
    left, right = _pair(inner.T)
    return Bars(top, bottom, left, right)


def _pair(content: npt.NDArray[np.bool_]) -> tuple[int, int]:
    size = content.shape[0]
    filled = np.flatnonzero(content.any(axis=1))
    if filled.size == 0:
        return 0, 0
    first, last = int(filled[0]), int(filled[-1])
    before, after = first, size - 1 - last
    is_pair = abs(before - after) <= max(2, size // 100)
    is_bar = min(before, after) >= LEAST_SHARE * size and before + after <= MOST_SHARE * size
    has_edge = content[first].mean() > 0.5 and content[last].mean() > 0.5
    return (before, after) if is_pair and is_bar and has_edge else (0, 0)
