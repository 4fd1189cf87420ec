"""The compiled kernels: the shared library, where it was built."""

from __future__ import annotations

import ctypes
import functools
import sys
from pathlib import Path

_VERSION = 9  # of the loops


_TYPES = {"p": ctypes.c_void_p, "n": ctypes.c_int64, "f": ctypes.c_float, "d": ctypes.c_double}


_ARGUMENTS = {
    "pack_literals": "pnnpp",
    "ycbcr_rows": "pppnpn" + "nnnnnnn" + "ppfp" + "ppp",
    "drive": "pppppnp",
    "camera_model": "ppppn" + "pndpp",
    "guided_coefficients": "ppnnnfpp" + "pppp",
    "guide_rows": "pnnff" + "nnnn" + "pnnn" + "pppp" + "nnp" + "pp",
    "gain_banterle2006": "pffnp",
    "gain_auto": "ppp" + "p" + "pppp" + "pn" + "ppp",
    "expand": "ppppp" + "fffn" + "ppp",
}


def library() -> ctypes.CDLL | None:
    """The compiled library; None where none was built, or one of another version."""
    return _found()[0]


def state() -> str:
    """Whether the compiled kernels run and, where they do not, why, in a few words."""
    return _found()[1]


@functools.lru_cache(maxsize=1)
def _found() -> tuple[ctypes.CDLL | None, str]:
    path = Path(__file__).with_name("_native.so")
    if sys.byteorder != "little":
        return None, "not running: they are for little-endian machines"
    if not path.exists():
        return None, f"not running: {path} was not built (install again with a C compiler)"
    try:
        loaded = ctypes.CDLL(str(path))
        version = loaded.itmo_version()
    except (OSError, AttributeError) as error:  # another system's, or an old one
        return None, f"not running: {error}"
    if version != _VERSION:
        return None, f"not running: {path} is of another version (install again)"
    for name, letters in _ARGUMENTS.items():
        function = getattr(loaded, f"itmo_{name}")
        function.argtypes, function.restype = [_TYPES[letter] for letter in letters], None
    return loaded, "running"
