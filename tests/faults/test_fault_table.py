"""A few trials of fault_table.py, each fault once; the whole table is run by hand."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from fault_table import FAULTS, LINES, QUICK, Whole, make_place, wrong


def can_mount() -> bool:
    if not sys.platform.startswith("linux") or shutil.which("unshare") is None:
        return False
    mount = "mkdir -p /tmp/.; mount -t tmpfs none /tmp"
    return subprocess.run(["unshare", "-m", "sh", "-c", mount], capture_output=True).returncode == 0


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if not can_mount():
        pytest.skip("a small disk cannot be mounted here")
    return make_place(tmp_path_factory.mktemp("place"))


@pytest.mark.timeout(200)
@pytest.mark.parametrize(("fault", "command"), QUICK)
def test_a_fault(fault: str, command: str, place: Path) -> None:
    for left in (place / "box").iterdir():
        shutil.rmtree(left) if left.is_dir() else left.unlink()
    assert list(wrong(place, fault, command, Whole(place))) == []


def test_the_quick_ones_are_of_the_table() -> None:
    assert {fault for fault, _ in QUICK} <= set(FAULTS)
    assert {command for _, command in QUICK} <= set(LINES)
