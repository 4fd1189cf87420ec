"""Standard streams closed, full, or read by nobody: work is done all the same, codes are right."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from clips import moving_scene, write_ffv1

COMMAND = f"{sys.executable} -m itmo_video"


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("clip")
    return write_ffv1(folder / "c.mkv", moving_scene(3, width=64, height=48))


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no /dev/full here")
@pytest.mark.parametrize(
    ("line", "code", "frames"),
    [
        ("convert {clip} {out} 2>&-", 0, 3),
        ("convert {clip} {out} >&-", 0, 3),
        ("convert {clip} {out} <&- >&- 2>&-", 0, 3),
        ("convert {clip} {out} 2>/dev/full", 0, 3),
        ("convert {clip} {out} --json >/dev/full", 0, 3),
        ("convert {clip} {out} --json | true", 0, 3),
        ("convert {clip} {out} --json | head -1", 0, 3),
        ("preview {clip} - >&-", 5, None),
        ("preview {clip} - >/dev/null", 0, None),
        ("preview {clip} - >/dev/full", 5, None),
        ("info {clip} >/dev/full", 5, None),
        ("info {clip} | true", 0, None),
        ("info {clip} >&-", 0, None),
        ("analyse {clip} >/dev/full", 5, None),
        ("operators | head -1", 0, None),
        ("convert missing.mkv {out} 2>&-", 3, None),
        ("convert missing.mkv {out} 2>/dev/full", 3, None),
    ],
)
def test_lost_streams(line: str, code: int, frames: int | None, clip: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    told = line.format(clip=clip, out=out)
    first, pipe, rest = told.partition(" | ")
    script = f"{COMMAND} {first}" + (f" {pipe} {rest}; exit ${{PIPESTATUS[0]}}" if pipe else "")
    done = subprocess.run(
        ["bash", "-c", script], capture_output=True, text=True, timeout=100, check=False
    )
    assert done.returncode == code, done.stderr
    assert "unexpected" not in done.stderr
    assert "Traceback" not in done.stderr
    assert "Exception" not in done.stderr
    if frames is not None:
        assert len(list(out.glob("*.exr"))) == frames
