"""A short run of tests/fuzz.py on clips of our own making."""

from __future__ import annotations

from pathlib import Path

from clips import moving_scene, write_ffv1, write_film
from fuzz import failures

NAMES = ("b.mp4", "c.mov", "d.ts")


def test_mutants_neither_crash_nor_hang(tmp_path: Path) -> None:
    files = [write_ffv1(tmp_path / "a.mkv", moving_scene(4, width=64, height=48))]
    files += [write_film(tmp_path / name, moving_scene(3, width=64, height=48)) for name in NAMES]
    bad = list(failures(files, 15, seed=1))
    assert not bad, f"mutants went wrong: {bad}"
