"""The C library's allocator in a worker.

Dask starts its workers with MALLOC_TRIM_THRESHOLD_=65536, so that freed memory goes back to the
system at once. A frame's arrays then come as new pages every time, which the system must clear:
that took as much time as rendering.
"""

from __future__ import annotations

import ctypes
import functools
from contextlib import suppress

# As in malloc.h of glibc. The values are those that glibc would arrive at by itself.
_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
_MMAP_BYTES = 32 << 20


@functools.cache
def keep_freed_memory() -> None:
    """Let glibc keep freed memory up to 64 MB for the next frame; elsewhere nothing is done."""
    with suppress(AttributeError, OSError, TypeError):  # no mallopt there, or no C library to ask
        mallopt = ctypes.CDLL(None).mallopt
        mallopt(_MMAP_THRESHOLD, _MMAP_BYTES)
        mallopt(_TRIM_THRESHOLD, 2 * _MMAP_BYTES)
