from __future__ import annotations

from pathlib import Path

import cv2
import pytest
from clips import moving_scene, write_ffv1
from piping import KINDS, encoded


@pytest.fixture(scope="module")
def films(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The moving scene by each of piping.KINDS."""
    folder = tmp_path_factory.mktemp("films")
    return {
        name: encoded(folder / name, codec, form, muxer)
        for name, (codec, form, muxer) in KINDS.items()
    }


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """14 smooth frames of 192 x 128 with a cut."""
    folder = tmp_path_factory.mktemp("clip")
    frames = moving_scene(14, width=192, height=128, cuts=(9,))
    return write_ffv1(folder / "scene.mkv", [cv2.GaussianBlur(f, (0, 0), 2) for f in frames])
