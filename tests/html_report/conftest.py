from __future__ import annotations

from pathlib import Path

import cv2
import pytest
from clips import moving_scene, write_ffv1
from hostile import HOSTILE

from itmo_video.cli.main import main


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("clip")
    frames = moving_scene(12, width=160, height=96, cuts=(7,))
    return write_ffv1(folder / HOSTILE, [cv2.GaussianBlur(f, (0, 0), 1.5) for f in frames])


@pytest.fixture(scope="module")
def folder(clip: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Converted by the command line, with its report."""
    out = tmp_path_factory.mktemp("report") / "out"
    command = ["convert", str(clip), str(out), "--layers", "expand_map", "--report", "--quiet"]
    assert main(command) == 0
    return out
