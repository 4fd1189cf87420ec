"""Large arrays of one frame after another in the same memory.

The system hands out memory page by page, each filled with zeros first: for the half floats of a
2160p frame that is an eighth of all its CPU time. C libraries keep freed memory only up to 32 MB.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Any

import numpy as np
import numpy.typing as npt

_MOST_FREE = 4  # of one size
# By size. Without a lock: a deque needs none, and garbage collection may free a room at any time.
_free: dict[int, deque[npt.NDArray[np.uint8]]] = {}


class _Room:
    """Memory of an array; offered again once neither the array nor a view of it is left.

    NumPy keeps what an array was made from (its `base`), for views of views, too.
    """

    def __init__(self, memory: npt.NDArray[np.uint8]) -> None:
        self._memory = memory
        self._store = _free.setdefault(memory.size, deque(maxlen=_MOST_FREE))
        self.__array_interface__ = memory.__array_interface__

    def __del__(self) -> None:
        self._store.append(self._memory)


def empty(shape: tuple[int, ...], dtype: npt.DTypeLike) -> npt.NDArray[Any]:
    """Np.empty, in memory of an earlier such array of the same size if that is gone."""
    size = math.prod(shape) * np.dtype(dtype).itemsize
    try:
        memory = _free[size].pop()
    except LookupError:
        memory = np.empty(size, np.uint8)
    return np.asarray(_Room(memory)).view(dtype).reshape(shape)


def release() -> None:
    """Give back to the system what is not in use."""
    _free.clear()
