"""Values at the ends of what fields and checks can hold."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from clips import moving_scene, write_ffv1

from itmo_video.cli.main import main


def test_a_film_is_the_same_bytes_twice(tmp_path: Path) -> None:
    clip = write_ffv1(tmp_path / "c.mkv", moving_scene(3, width=64, height=48))
    for name in ("a.mkv", "b.mkv"):
        line = ["preview", str(clip), str(tmp_path / name), "--speed", "13", "--quiet"]
        assert main(line) == 0
    assert (tmp_path / "a.mkv").read_bytes() == (tmp_path / "b.mkv").read_bytes()


@pytest.mark.parametrize("name", ["a.mp4", "a.png"])
def test_a_peak_beyond_the_metadata(name: str, tmp_path: Path) -> None:
    clip = write_ffv1(tmp_path / "c.mkv", moving_scene(2, width=64, height=48))
    line = ["preview", str(clip), str(tmp_path / name), "--peak-nits", "1000000", "--quiet"]
    assert main([*line, *(["--frame", "1"] if name == "a.png" else ["--speed", "13"])]) == 0


@pytest.mark.parametrize("value", ["nan", "inf", "-inf"])
def test_no_check_against_what_is_no_number(value: str, tmp_path: Path) -> None:
    line = ["evaluate", str(tmp_path), "--reference", str(tmp_path)]
    assert main([*line, "--fail-above", f"gain_flicker={value}"]) == 2


def test_a_sequence_numbered_by_billions(tmp_path: Path) -> None:
    for number in (1, 2_000_000_000):
        cv2.imwrite(str(tmp_path / f"s.{number}.png"), np.zeros((8, 8, 3), np.uint8))
    assert main(["convert", str(tmp_path / "s.%d.png"), str(tmp_path / "o"), "--dry-run"]) == 3
