"""kill -9 of the commands that write: the same bytes after it, and no trace."""

from __future__ import annotations

import os
import sys
import tempfile
from collections import Counter
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from random_kills import Place, kills

from itmo_video.output.atomic import sweep_temp_folders, temp_path

ROUNDS = int(os.environ.get("ITMO_VIDEO_KILL_ROUNDS", "2"))


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="finds processes by /proc")
@pytest.mark.parametrize("command", ["preview", "report", "analyse"])
def test_killed_and_run_again(command: str, tmp_path: Path) -> None:
    """laws/test_kill.py kills `convert`; random_kills.py `--scheduler local`, too."""
    place = Place(tmp_path, frames=20)
    assert list(kills(place, command, ROUNDS, 22, Counter())) == []


def test_temporary_folders_of_the_dead_are_removed(tmp_path: Path) -> None:
    mine = temp_path(tmp_path / "dask")
    owner = mine.name.split("-")
    owner[4:6] = ["4194305", "1"]  # no process has such a number
    dead, other = tmp_path / "-".join(owner), tmp_path / ".itmo-something.tmp"
    for folder in (mine, dead, other):
        folder.mkdir()
        (folder / "file").touch()
    sweep_temp_folders(tmp_path)
    assert (mine.exists(), dead.exists(), other.exists()) == (True, False, True)
    sweep_temp_folders(tmp_path / "gone")
    assert Path(tempfile.gettempdir()).is_dir()
