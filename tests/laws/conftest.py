from __future__ import annotations

from pathlib import Path

import pytest
from clips import moving_scene, write_ffv1
from cluster_runs import SETTINGS, files

from itmo_video import convert


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    frames = moving_scene(120, width=128, height=72, cuts=(17, 18, 70))
    return write_ffv1(tmp_path_factory.mktemp("clip") / "scene.mkv", frames)


@pytest.fixture(scope="module")
def whole(clip: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    out = tmp_path_factory.mktemp("whole")
    convert(clip, out, SETTINGS)
    return files(out)
