from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

from itmo_video.kernels import library

# No test reads the config file of whoever runs it.
os.environ["XDG_CONFIG_HOME"] = os.path.join(os.sep, "nonexistent", "itmo-video-tests")
sys.path.insert(0, str(Path(__file__).parent))
# No test depends on how busy the machine is. In CI the parent profile is Hypothesis' own for it.
settings.register_profile("without_deadline", settings(), deadline=None)
settings.load_profile("without_deadline")
pytest_plugins = ["skips", "browser", "compiled_kernels"]


@pytest.fixture(scope="module", params=["compiled", "libraries"])
def loops(request: pytest.FixtureRequest) -> Iterator[None]:
    """What the compiled loops do, by them and then by NumPy and OpenCV, as without a compiler."""
    if request.param == "compiled" and library.library() is None:
        pytest.skip("installed without a C compiler")
    with pytest.MonkeyPatch.context() as patch:
        if request.param == "libraries":
            patch.setattr(library, "library", lambda: None)
        yield
