"""One frame cut short, one empty, one of other settings: named, mended, asked about."""

from __future__ import annotations

from pathlib import Path

import pytest
from clips import moving_scene, write_ffv1
from same_bytes import assert_same_bytes

from itmo_video import RunOptions, convert, make_settings
from itmo_video.conversion import checking
from itmo_video.errors import CheckFailedError, OutputError

SETTINGS = make_settings("paper", lights=16, radius=64)
RUN = RunOptions()


def test_three_of_200(tmp_path: Path) -> None:
    clip = write_ffv1(tmp_path / "clip.mkv", moving_scene(200, width=48, height=32, cuts=(90,)))
    out, elsewhere = tmp_path / "out", tmp_path / "elsewhere"
    convert(clip, out, SETTINGS)
    whole = {path.name: path.read_bytes() for path in out.iterdir()}
    other = make_settings("paper", lights=16, radius=64, peak_nits=4000.0)
    convert(clip, elsewhere, other, RunOptions(frames="150"))

    def frame(number: int) -> Path:
        return out / f"clip.{number:04d}.exr"

    frame(20).write_bytes(frame(20).read_bytes()[:-40])
    frame(99).write_bytes(b"")
    frame(150).write_bytes((elsewhere / frame(150).name).read_bytes())

    faults = checking.verify(clip, out, SETTINGS, RUN)
    assert [path for path, _ in faults] == [frame(20), frame(99), frame(150)]
    with pytest.raises(CheckFailedError) as failed:
        checking.require_sound(faults)
    assert failed.value.exit_code == 7
    assert "frames 20,99: damaged" in str(failed.value)
    assert f"{frame(150)}: rendered with other settings" in str(failed.value)

    with pytest.raises(OutputError, match="frame 150 rendered with other settings") as refused:
        convert(clip, out, SETTINGS)
    assert "--update" in str(refused.value)
    assert [path for path, _ in checking.verify(clip, out, SETTINGS, RUN)] == [frame(150)]
    assert convert(clip, out, SETTINGS, RunOptions(update=True)).written == 1
    assert_same_bytes(out, whole, "mending leaves another folder")
