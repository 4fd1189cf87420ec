"""Memory is bounded by jobs and span, whatever the clip's length."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from clips import moving_scene, write_ffv1

CODE = """
import resource, sys
from itmo_video import RunOptions, convert, make_settings
convert(sys.argv[1], '-', make_settings(), RunOptions(jobs=2, null=True))
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


def peak_kb(clip: Path) -> int:
    run = subprocess.run(
        [sys.executable, "-c", CODE, str(clip)],
        capture_output=True, text=True, check=True, timeout=240,
    )  # fmt: skip
    return int(run.stdout)


def test_memory_does_not_grow_with_the_clip(tmp_path: Path) -> None:
    frames = list(moving_scene(60, width=640, height=360))
    short = write_ffv1(tmp_path / "short.mkv", frames)
    long = write_ffv1(tmp_path / "long.mkv", frames * 4)
    a, b = peak_kb(short), peak_kb(long)
    assert b < 1.1 * a, f"60 frames took {a} kB, 240 frames {b} kB"
