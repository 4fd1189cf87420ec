"""One entry a kernel: its compiled form where the library is loaded, else its plain one."""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Callable
from typing import Concatenate, ParamSpec, TypeVar

from itmo_video.kernels import library

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


def with_compiled_form(
    compiled_form: Callable[Concatenate[ctypes.CDLL, Arguments], Result],
) -> Callable[[Callable[Arguments, Result]], Callable[Arguments, Result]]:
    """Decorate a kernel's plain form, by NumPy and OpenCV, with its compiled one.

    What is called then is either: `compiled_form(library, ...)` where the compiled library is
    loaded, else the decorated function with the same arguments. That one is what an installation
    without a compiler runs and, at once, the oracle that tests hold the compiled form against.
    """

    def decorate(plain_form: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
        @functools.wraps(plain_form)
        def kernel(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Result:
            # Asked at each call, as tests take the library away.
            if (loaded := library.library()) is not None:
                return compiled_form(loaded, *args, **kwargs)
            return plain_form(*args, **kwargs)

        return kernel

    return decorate
