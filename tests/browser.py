"""A headless Chromium for tests of pages."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
FLAGS = [
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--no-first-run", "--disable-quic",
]  # fmt: skip


@contextmanager
def chromium() -> Iterator[Any]:
    """Playwright's browser; the test is skipped where there is none."""
    if CHROMIUM is None:
        pytest.skip("Chromium is not installed (apt-get install chromium)")
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with TemporaryDirectory() as folder, sync_api.sync_playwright() as play:
        opened = play.chromium.launch(executable_path=_modest(Path(folder)), args=FLAGS)
        yield opened
        opened.close()


def _modest(folder: Path) -> str:
    """Chromium without the right to real-time threads, which as root it takes.

    Two of its renderers once took both cores of a loaded machine for minutes, ahead of all else.
    """
    assert CHROMIUM is not None
    if os.geteuid() != 0 or shutil.which("setpriv") is None:
        return CHROMIUM
    script = folder / "chromium"
    script.write_text(
        f'#!/bin/sh\nexec setpriv --bounding-set=-sys_nice --inh-caps=-sys_nice {CHROMIUM} "$@"\n'
    )
    script.chmod(0o755)
    return str(script)
