"""Frames of one folder, and of one cluster run, are computed with one arithmetic."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from clips import exr_bytes, moving_scene, write_ffv1

from itmo_video import OutputError, RunOptions, convert, make_settings
from itmo_video.cli.main import main
from itmo_video.conversion import plan
from itmo_video.kernels.arithmetic import arithmetic


@pytest.fixture
def clip(tmp_path: Path) -> Path:
    return write_ffv1(tmp_path / "c.mkv", moving_scene(4, width=64, height=48))


def test_another_arithmetic_does_not_go_on_unasked(
    clip: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = make_settings(lights=16)
    convert(clip, tmp_path / "o", settings, RunOptions(frames="1-2"))
    before = exr_bytes(tmp_path / "o")
    monkeypatch.setattr(plan, "arithmetic", lambda: "libraries-other-plain-plain")
    with pytest.raises(OutputError, match="arithmetic"):
        convert(clip, tmp_path / "o", settings)
    assert exr_bytes(tmp_path / "o") == before
    convert(clip, tmp_path / "o", settings, RunOptions(update=True))
    after = exr_bytes(tmp_path / "o")
    assert len(after) == 4
    assert not before.items() & after.items(), "frames of two kinds lie in one folder"


def test_it_tells_what_libraries_are_told_to_leave_out() -> None:
    script = "from itmo_video.kernels.arithmetic import arithmetic; print(arithmetic())"
    without = {"OPENCV_CPU_DISABLE": "AVX2"}
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", script],
        env={**os.environ, **without}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    if "AVX" in arithmetic():
        assert done.stdout.strip() != arithmetic()


def test_a_worker_that_computes_otherwise_is_refused(clip: Path, tmp_path: Path) -> None:
    from itmo_video.cluster.chunks import cut_into_chunks, try_chunk
    from itmo_video.conversion.convert import Job
    from itmo_video.conversion.plan import make_plan
    from itmo_video.errors import ClusterError
    from itmo_video.look import make_look
    from itmo_video.output.folder import OutputFolder
    from itmo_video.source.opening import open_clip

    run = RunOptions(null=True)
    with open_clip(clip) as opened:
        made = make_plan(opened, make_look(make_settings(lights=16)), run)
        folder = OutputFolder(tmp_path / "o", made.clip.stem)
        (chunk,) = cut_into_chunks(Job(opened, made, folder, run, made.numbers), 1)
    found = try_chunk(replace(chunk, arithmetic="libraries-other-plain-plain"))
    assert isinstance(found, ClusterError)
    assert "computes differently" in str(found)


@pytest.mark.parametrize("address", ["nonsense://here:1", "tcp://host:port", ":::"])
def test_a_bad_address_is_wrong_usage(
    address: str, clip: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("distributed")
    code = main(["convert", str(clip), str(tmp_path / "o"), "--quiet", "--scheduler", address])
    assert code == 2, capsys.readouterr().err
