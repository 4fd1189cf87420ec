from __future__ import annotations

from pathlib import Path

import pytest
from analysis_settings import SETTINGS
from clips import moving_scene, write_ffv1

from itmo_video import analyse
from itmo_video.analysis.model import Analysis


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    frames = moving_scene(30, cuts=(17, 18))
    return write_ffv1(tmp_path_factory.mktemp("clip") / "scene.mkv", frames)


@pytest.fixture(scope="module")
def found(clip: Path) -> Analysis:
    return analyse(clip, SETTINGS)
