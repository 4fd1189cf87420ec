"""The compiled kernels in tests: whether they are here, and their functions without them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from itmo_video.kernels import library

ByLibraries = Callable[..., Any]

loaded: Any = library.library()  # None without a C compiler; tests of it are marked
needs_kernels = pytest.mark.skipif(loaded is None, reason="installed without a C compiler")


@pytest.fixture
def by_libraries(monkeypatch: pytest.MonkeyPatch) -> ByLibraries:
    """Call a function as if nothing had been compiled."""

    def call(function: Any, *arguments: object) -> Any:
        with monkeypatch.context() as patch:
            patch.setattr(library, "library", lambda: None)
            return function(*arguments)

    return call
