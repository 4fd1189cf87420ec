"""A short run of tests/fuzz.py on clips of our own making."""

from __future__ import annotations

from pathlib import Path

from clips import SHARED, moving_scene, write_ffv1
from fuzz import failures


def test_mutants_neither_crash_nor_hang(tmp_path: Path) -> None:
    files = [write_ffv1(tmp_path / "a.mkv", moving_scene(4, width=64, height=48))]
    odd = SHARED / "data/odd_clips"
    files += [p for p in (odd / "unordered.mov", odd / "2x2-green.mp4") if p.exists()]
    bad = list(failures(files, 15, seed=1))
    assert not bad, f"mutants went wrong: {bad}"
