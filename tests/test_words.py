"""Counts as people say them, in what commands print."""

from __future__ import annotations

from pathlib import Path

import pytest
from clips import moving_scene, write_ffv1

from itmo_video.cli.main import main
from itmo_video.words import counted, missing


def test_one_has_no_s() -> None:
    assert [counted(n, "frame") for n in (0, 1, 2)] == ["0 frames", "1 frame", "2 frames"]
    assert missing(1, "frame") == "1 frame is missing"
    assert missing(3, "frame") == "3 frames are missing"


def test_one_frame_is_made(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    clip = write_ffv1(tmp_path / "a.mkv", moving_scene(1))
    assert main(["convert", str(clip), str(tmp_path / "out"), "--dry-run"]) == 0
    assert "1 frame (1) of" in capsys.readouterr().out
    assert main(["convert", str(clip), str(tmp_path / "out")]) == 0
    assert "1 frame made" in capsys.readouterr().err


def test_no_flag_is_called_after_its_variable(capsys: pytest.CaptureFixture[str]) -> None:
    for command in ("convert", "preview", "analyse", "evaluate", "report"):
        with pytest.raises(SystemExit):
            main([command, "--help"])
        told = capsys.readouterr().out
        assert "SET_" not in told
        assert "without a preset" not in told
