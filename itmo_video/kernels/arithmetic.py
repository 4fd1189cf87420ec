"""The arithmetic of a process: its kernels, and the vector units that libraries use.

OpenCV and NumPy choose their loops by the processor, with different rounding; the compiled kernels
and their fallbacks differ, too. Identical bytes are guaranteed for one arithmetic only.
"""

from __future__ import annotations

import functools
import platform

import cv2
import numpy as np

from itmo_video.kernels import library

_LEVELS = ("AVX512", "AVX2", "AVX", "SSE4", "NEON")  # best first
_NUMPY = {"X86_V4": "AVX512", "X86_V3": "AVX2", "X86_V2": "SSE4"}  # names of NumPy 2.4


def arithmetic() -> str:
    """The arithmetic that output bytes depend on, such as "compiled-x86_64-AVX2-AVX512"."""
    kernels = "compiled" if library.library() is not None else "libraries"
    return "-".join((kernels, platform.machine(), *_vector_units()))


@functools.lru_cache(maxsize=1)
def _vector_units() -> tuple[str, str]:
    """The best levels that OpenCV and NumPy use here; both can be told to disable some."""
    # "SSE2 *SSE4.2 *AVX2?": * is chosen at run time, ? is not available.
    line = [word.strip("*") for word in cv2.getCPUFeaturesLine().split() if word[-1] != "?"]
    core = getattr(np, "_core", None)
    known = getattr(getattr(core, "_multiarray_umath", None), "__cpu_features__", {})
    has = [_NUMPY.get(name, name) for name, there in known.items() if there]
    return _best(line), _best(has)


def _best(names: list[str]) -> str:
    return next((level for level in _LEVELS if any(n.startswith(level) for n in names)), "plain")
