from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import driven
import pytest


@pytest.fixture
def address(tmp_path: Path) -> Iterator[str]:
    """The page of a studio on a sample clip, which saves to `tmp_path`."""
    with driven.studio(driven.CLIP, tmp_path) as found:
        yield found
