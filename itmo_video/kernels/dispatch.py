"""One function per kernel: its compiled form if the library is loaded, else its plain form."""

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
    """Decorate a kernel's plain form, in NumPy and OpenCV, with its compiled one.

    The result calls `compiled_form(library, ...)` if the compiled library is loaded, otherwise the
    decorated function with the same arguments. The latter is what an installation without a
    compiler runs, and also the oracle that tests compare the compiled form with.
    """

    def decorate(plain_form: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
        @functools.wraps(plain_form)
        def kernel(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Result:
            # Checked at each call, as tests disable the library.
            if (loaded := library.library()) is not None:
                return compiled_form(loaded, *args, **kwargs)
            return plain_form(*args, **kwargs)

        return kernel

    return decorate
