"""Which arithmetic a process computes with: its kernels, and the vector units that libraries use.

OpenCV and NumPy choose their loops by the processor, and round differently with each; so do the
compiled kernels and what stands in for them. The same bytes are promised for one arithmetic.
"""

from __future__ import annotations

import functools
import platform

import cv2
import numpy as np

from itmo_video.kernels import library

_LEVELS = ("AVX512", "AVX2", "AVX", "SSE4", "NEON")  # the best first
_NUMPY = {"X86_V4": "AVX512", "X86_V3": "AVX2", "X86_V2": "SSE4"}  # names of NumPy 2.4


def arithmetic() -> str:
    """What bytes depend on beside settings and source, such as "compiled-x86_64-AVX2-AVX512"."""
    kernels = "compiled" if library.library() is not None else "libraries"
    return "-".join((kernels, platform.machine(), *_vector_units()))


@functools.lru_cache(maxsize=1)
def _vector_units() -> tuple[str, str]:
    """The best that OpenCV and NumPy use here; both can be made to do without some."""
    # "SSE2 *SSE4.2 *AVX2?": a star for what is chosen as it runs, ? for what is not there.
    line = [word.strip("*") for word in cv2.getCPUFeaturesLine().split() if word[-1] != "?"]
    core = getattr(np, "_core", None)
    known = getattr(getattr(core, "_multiarray_umath", None), "__cpu_features__", {})
    has = [_NUMPY.get(name, name) for name, there in known.items() if there]
    return _best(line), _best(has)


def _best(names: list[str]) -> str:
    return next((level for level in _LEVELS if any(n.startswith(level) for n in names)), "plain")
