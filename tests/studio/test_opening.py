"""The page is opened in the browser without its secret in the arguments of a process."""

from __future__ import annotations

import signal
import stat
from pathlib import Path
from urllib.parse import urlsplit

import command
import pytest
from browser import PATIENCE_S, chromium, until
from command import start
from driven import CLIP


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def test_the_secret_is_read_from_a_private_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said, script = tmp_path / "said", tmp_path / "browser"
    script.write_text(f'#!/bin/sh\nprintf %s "$*" > {said}.part && mv {said}.part {said}\n')
    script.chmod(0o700)
    monkeypatch.setitem(command.ENVIRONMENT, "BROWSER", f"{script} %s")
    process = start("studio", CLIP, "--folder", tmp_path)
    try:
        assert process.stdout is not None
        address = process.stdout.readline().strip()
        until(said.exists, "no browser was opened")
        token = urlsplit(address).path.strip("/")
        assert token not in said.read_text()
        page = Path(urlsplit(said.read_text()).path)
        assert (mode(page), mode(page.parent)) == (0o600, 0o700)
        with chromium() as browser:
            tab = browser.new_page()
            tab.goto(said.read_text())
            tab.wait_for_selector("body[data-ready]", timeout=PATIENCE_S * 1e3)
            assert tab.url == address
        assert not page.parent.exists(), "it stays when the page has been opened"
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)
    assert process.returncode == 0
