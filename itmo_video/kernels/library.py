"""Loading the shared library of compiled kernels, if it was built."""

from __future__ import annotations

import ctypes
import functools
import sys
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

_VERSION = 26  # of the kernels


class _Array:
    """An argument that must be a contiguous array of one dtype, or None; else ctypes raises."""

    def __init__(self, dtype: npt.DTypeLike) -> None:
        self._dtype = np.dtype(dtype)

    def from_param(self, array: npt.NDArray[Any] | None) -> ctypes.c_void_p | None:
        if array is None:
            return None
        if array.dtype != self._dtype:
            raise TypeError(f"an array is {array.dtype}, not {self._dtype}")
        if not array.flags.c_contiguous:
            raise ValueError(f"an array of shape {array.shape} has strides {array.strides}")
        return ctypes.c_void_p(array.ctypes.data)


class _Lines:
    """An argument that must be a plane with contiguous lines; there may be gaps between lines."""

    def from_param(self, plane: npt.NDArray[Any]) -> ctypes.c_void_p:
        if plane.dtype.kind not in "uf" or plane.itemsize > 4 or not plane.dtype.isnative:
            raise TypeError(f"a plane is {plane.dtype}")
        if plane.ndim != 2 or plane.strides[1] != plane.itemsize:
            raise ValueError(f"a plane of shape {plane.shape} has strides {plane.strides}")
        return ctypes.c_void_p(plane.ctypes.data)


_TYPES: dict[str, Any] = {
    "n": ctypes.c_int64, "f": ctypes.c_float, "d": ctypes.c_double, "p": _Lines(),
    "B": _Array(np.uint8), "I": _Array(np.int32), "L": _Array(np.int64),
    "H": _Array(np.float16), "W": _Array(np.uint16),
    "F": _Array(np.float32), "D": _Array(np.float64),
}  # fmt: skip


# As in loops.h (tests/kernels/test_native.py compares): lower case is a number or a plane's lines.
_ARGUMENTS = {
    "pack_literals": "BnnBL",
    "ycbcr_rows": "pppnLn" + "nnnnnnn" + "FFFF" + "FFF",
    "halved_light": "pppnLn" + "nnnnnnn" + "FFFF" + "FFF",
    "weighted_sum": "FFFFFnF",
    "camera_model": "DDDDn" + "DndDD",
    "guided_coefficients": "FFnnnfFD" + "FFFF",
    "guide_rows": "pnnff" + "nnnn" + "Fnnn" + "LFIF" + "nnF" + "FF",
    "gain_banterle2006": "FffnF",
    "gain_auto": "FFF" + "F" + "FFFF" + "FnnF" + "FFF",
    "auto_from_codes": "pppnLLFF" + "FLFIF" + "LBFF" + "HHH",
    "add_weighed": "FFnnF",
    "blend": "FFFnnF",
    "halves": "FnH",
    "area_means": "pnnL" + "IFIF" + "FB",
    "blurred": "FnnnnFFF",
    "greatest": "FnF",
    "luminance": "FnF",
    "weighed_by_light": "FffnFF",
    "mean_colour": "FFFfnF",
    "share_ramps": "FFfffnF",
    "with_near": "FFffnF",
    "bounded_parting": "FFFFnF",
    "held_together": "FFFnF",
    "network": "FnnF" + "FF",
    "network_features": "FnnffffF",
    "srgb_codes": "FnF",
    "network_filters": "FnnnF",
    "ramps": "Fff" + "nF",
    "expand_auto": "FFF" + "F" + "FFFF" + "F" + "fnnF" + "HHH",
    "expand": "FFFFF" + "fffn" + "HHH",
    "to_codes": "ppp" + "LLFFF" + "WWW" + "D",
}


def library() -> ctypes.CDLL | None:
    """The compiled library; None if it was not built, or has another version."""
    return _found()[0]


def state() -> str:
    """Whether the compiled kernels run, with the reason if not."""
    return _found()[1]


@functools.lru_cache(maxsize=1)
def _found() -> tuple[ctypes.CDLL | None, str]:
    path = Path(__file__).with_name("_native.so")
    if sys.byteorder != "little":
        return None, "not running: they need a little-endian machine"
    if not path.exists():
        return None, f"not running: {path} was not built (install again with a C compiler)"
    try:
        loaded = ctypes.CDLL(str(path))
        version = loaded.itmo_version()
    except (OSError, AttributeError) as error:  # built for another system, or an old one
        return None, f"not running: {error}"
    if version != _VERSION:
        return None, f"not running: {path} has another version (install again)"
    for name, letters in _ARGUMENTS.items():
        function = getattr(loaded, f"itmo_{name}")
        function.argtypes, function.restype = [_TYPES[letter] for letter in letters], None
    return loaded, "running"
