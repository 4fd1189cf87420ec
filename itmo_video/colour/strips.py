"""A frame's rows, a strip at a time."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from itmo_video.model import Float32

# With fewer, threads wait for each other's GIL; with more, planes leave the cache.
STRIP_ROWS = 120


def strips(height: int) -> Iterator[slice]:
    """Rows of a frame, STRIP_ROWS at a time."""
    for top in range(0, height, STRIP_ROWS):
        yield slice(top, min(top + STRIP_ROWS, height))


def with_reach(rows: slice, reach: int, height: int) -> tuple[slice, slice]:
    """Rows of a frame and up to `reach` more above and below, and where the rows are in these."""
    wide = slice(max(0, rows.start - reach), min(height, rows.stop + reach))
    return wide, slice(rows.start - wide.start, rows.stop - wide.start)


def strip_buffers(rows: slice, width: int) -> tuple[Float32, Float32, Float32]:
    """Empty R, G and B for some rows of a frame: three float32 arrays of (rows, width)."""
    shape = (rows.stop - rows.start, width)
    return np.empty(shape, np.float32), np.empty(shape, np.float32), np.empty(shape, np.float32)
