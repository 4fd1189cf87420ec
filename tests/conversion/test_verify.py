"""--verify with other flags than the conversion's: what differs is named."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from clips import moving_scene, write_ffv1

from itmo_video.cli.main import main


def test_a_flag_left_out_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    clip = write_ffv1(tmp_path / "c.mkv", moving_scene(2, width=32, height=24))
    command = ["convert", str(clip), str(tmp_path / "out")]
    other = ["--primaries", "acescg"]
    assert main([*command, *other, "--quiet"]) == 0
    assert main([*command, *other, "--verify"]) == 0
    capsys.readouterr()
    assert main([*command, "--verify"]) == 7
    told = capsys.readouterr().err
    assert 'primaries "acescg" -> "rec709"' in told
    assert "all flags of the conversion" in told


def test_what_was_verified_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    clip = write_ffv1(tmp_path / "c.mkv", moving_scene(3, width=32, height=24))
    command = ["convert", str(clip), str(tmp_path / "out")]
    assert main([*command, "--quiet"]) == 0
    for flags, told in (
        ((), "all frames are"),
        (("2-3",), "frames 2-3 are"),
        (("2",), "frame 2 is"),
    ):
        assert main([*command, "--verify", *[f for n in flags for f in ("--frames", n)]]) == 0
        assert f"out: {told} present and intact" in capsys.readouterr().out
    shutil.copy(tmp_path / "out/c.0002.exr", tmp_path / "out/c.0099.exr")
    assert main([*command, "--verify", "--frames", "2"]) == 0
    assert main([*command, "--verify"]) == 7, "preview would refuse the folder, too"
    assert "c.0099.exr: no frame of this clip" in capsys.readouterr().err
