"""What native.c does, where it was built; without it callers do with libraries, slower."""

from __future__ import annotations

import ctypes
import functools
import sys
from pathlib import Path

import numpy as np
import numpy.typing as npt

Bytes2D = npt.NDArray[np.uint8]

_VERSION = 1  # of native.c's functions
_BLOCK_ROOM = 2 * 1024 + 32  # HEADER_ROOM for both blocks, zlib's own bytes and the writer's last


@functools.lru_cache(maxsize=1)
def library() -> ctypes.CDLL | None:
    """The compiled library; None where none was built, or one of another version."""
    path = Path(__file__).with_name("_native.so")
    if sys.byteorder != "little" or not path.exists():
        return None
    try:
        loaded = ctypes.CDLL(str(path))
        if loaded.itmo_version() != _VERSION:
            return None
    except (OSError, AttributeError):  # another system's, or an old one
        return None
    size, pointer = ctypes.c_int64, ctypes.c_void_p
    loaded.itmo_pack_literals.argtypes = [pointer, size, size, pointer, pointer]
    loaded.itmo_pack_literals.restype = None
    return loaded


def pack_literals(loaded: ctypes.CDLL, rows: Bytes2D) -> list[bytes]:
    """Each row (count, size) as a zlib stream that says its bytes in Huffman's code, no repeats.

    The rows share two codes, one of their first halves and one of their second halves: EXR puts
    the lower bytes of its pixels there and the upper ones here. `rows` are contiguous, of an even
    size above 0, and less than 2**31 bytes in all. Other threads run meanwhile.
    """
    count, size = rows.shape
    if size < 2 or size % 2 or not rows.flags.c_contiguous or rows.size >= 2**31:
        raise ValueError(f"rows of shape {rows.shape} cannot be packed")
    out = np.empty(count * (size * 14 // 8 + _BLOCK_ROOM), np.uint8)
    ends = np.empty(count, np.int64)
    loaded.itmo_pack_literals(rows.ctypes.data, count, size, out.ctypes.data, ends.ctypes.data)
    starts = [0, *ends[:-1].tolist()]
    return [out[a:b].tobytes() for a, b in zip(starts, ends.tolist(), strict=True)]
