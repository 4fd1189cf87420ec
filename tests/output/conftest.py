from __future__ import annotations

from pathlib import Path

import pytest

from itmo_video.output.folder import OutputFolder


@pytest.fixture
def out(tmp_path: Path) -> OutputFolder:
    return OutputFolder(tmp_path / "out", "clip")
