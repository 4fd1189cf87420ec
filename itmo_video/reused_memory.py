"""Large arrays of one frame after another in the same memory.

The system hands out memory page by page, each filled with zeros first: for the half floats of a
2160p frame that is an eighth of all its CPU time. C libraries keep freed memory only up to 32 MB.
Only while a clip is rendered (`kept`): what comes one by one may have any size.
"""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import numpy.typing as npt

_MOST_FREE = 4  # of one size
# By size. Without a lock: a deque needs none, and garbage collection may free a room at any time.
_free: dict[int, deque[npt.NDArray[np.uint8]]] = {}
_renders: list[object] = []  # in progress
_changing = threading.Lock()


class _Room:
    """Memory of an array; offered again once neither the array nor a view of it is left.

    NumPy keeps what an array was made from (its `base`), for views of views, too.
    """

    def __init__(self, memory: npt.NDArray[np.uint8]) -> None:
        self._memory = memory
        self._store = _free.setdefault(memory.size, deque(maxlen=_MOST_FREE))
        self.__array_interface__ = memory.__array_interface__

    def __del__(self) -> None:
        if _renders:
            self._store.append(self._memory)


def empty(shape: tuple[int, ...], dtype: npt.DTypeLike) -> npt.NDArray[Any]:
    """Np.empty; within `kept`, in memory of an earlier array of the same size that is gone."""
    if not _renders:
        return np.empty(shape, dtype)
    size = math.prod(shape) * np.dtype(dtype).itemsize
    try:
        memory = _free[size].pop()
    except LookupError:
        memory = np.empty(size, np.uint8)
    return np.asarray(_Room(memory)).view(dtype).reshape(shape)


@contextmanager
def kept() -> Iterator[None]:
    """Keep what `empty` has handed out for the next; after the last of several, give it back."""
    render = object()
    _renders.append(render)
    try:
        yield
    finally:
        with _changing:
            _renders.remove(render)
            if not _renders:
                _free.clear()
