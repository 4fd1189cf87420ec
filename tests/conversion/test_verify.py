"""--verify with other flags than the conversion's: what differs is named."""

from __future__ import annotations

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
