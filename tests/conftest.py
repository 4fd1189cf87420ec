from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from itmo_video.kernels import library

sys.path.insert(0, str(Path(__file__).parent))
pytest_plugins = ["skips"]


@pytest.fixture(scope="module", params=["compiled", "libraries"])
def loops(request: pytest.FixtureRequest) -> Iterator[None]:
    """What the compiled loops do, by them and then by NumPy and OpenCV, as without a compiler."""
    if request.param == "compiled" and library.library() is None:
        pytest.skip("installed without a C compiler")
    with pytest.MonkeyPatch.context() as patch:
        if request.param == "libraries":
            patch.setattr(library, "library", lambda: None)
        yield
