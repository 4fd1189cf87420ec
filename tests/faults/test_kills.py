"""kill -9 of the commands that write single files: the same bytes after it, and no trace."""

from __future__ import annotations

import os
import random
import time
from pathlib import Path

import pytest
from clips import moving_scene, write_ffv1
from command import run, start, temp_files

ROUNDS = int(os.environ.get("ITMO_VIDEO_KILL_ROUNDS", "3"))
LINES = {
    "preview": ("preview", "c.mkv", "film.mkv", "--speed", "13", "--quiet"),
    "report": ("report", "o", "--output", "page.html", "--quiet"),
    "analyse": ("analyse", "c.mkv", "--output", "a.json", "--quiet"),
}


@pytest.mark.skipif(os.name == "nt", reason="POSIX signals")
@pytest.mark.parametrize("command", LINES)
def test_killed_and_run_again(command: str, tmp_path: Path) -> None:
    clip = write_ffv1(tmp_path / "c.mkv", moving_scene(30, width=96, height=64))
    assert run("convert", clip, tmp_path / "o", "--lights", 64).returncode == 0
    line = [
        tmp_path / word if word in ("c.mkv", "o", "film.mkv", "page.html", "a.json") else word
        for word in LINES[command]
    ]
    output = next(
        word for word in line if isinstance(word, Path) and word.name not in ("c.mkv", "o")
    )
    began = time.monotonic()
    assert run(*line).returncode == 0
    seconds, whole = time.monotonic() - began, output.read_bytes()
    rng = random.Random(22)
    for _ in range(ROUNDS):
        output.unlink()
        process = start(*line)
        time.sleep(rng.uniform(0.3, 1) * seconds)
        process.kill()
        process.communicate(timeout=20)
        if output.exists():
            assert output.read_bytes() == whole, "a part of the file bears its name"
            output.unlink()
        assert run(*line).returncode == 0
        assert output.read_bytes() == whole
        assert temp_files(tmp_path) == temp_files(tmp_path / "o") == []
