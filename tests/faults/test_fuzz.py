"""A short run of tests/faults/fuzz.py on clips of our own making."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import fuzz_inputs
from clips import moving_scene, write_ffv1, write_film
from fuzz import failures

NAMES = ("b.mp4", "c.mov", "d.ts")


def test_mutants_neither_crash_nor_hang(tmp_path: Path) -> None:
    files = [write_ffv1(tmp_path / "a.mkv", moving_scene(4, width=64, height=48))]
    files += [write_film(tmp_path / name, moving_scene(3, width=64, height=48)) for name in NAMES]
    bad = list(failures(files, 15, seed=1))
    assert not bad, f"mutants went wrong: {bad}"


def test_mutants_of_stills_are_whole_or_refused(tmp_path: Path) -> None:
    """In a process of its own, which no library has started threads in: it forks."""
    stills = [str(path) for path in fuzz_inputs.made_stills(tmp_path)]
    command = [sys.executable, fuzz_inputs.__file__, "--count", "40", "--seed", "5", *stills]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
