"""The studio's process: how it is opened, kept from, and ended."""

from __future__ import annotations

import signal
import socket
import urllib.request
from contextlib import suppress
from pathlib import Path

import pytest
from command import run, start
from driven import CLIP, studio


@pytest.mark.parametrize(("sent", "code"), [(signal.SIGINT, 0), (signal.SIGTERM, 143)])
def test_it_says_that_it_is_closed(tmp_path: Path, sent: signal.Signals, code: int) -> None:
    folder = tmp_path / "made" / "here"
    process = start("studio", CLIP, "--no-browser", "--folder", folder)
    assert process.stdout is not None
    address = process.stdout.readline().strip()
    assert address.startswith("http://127.0.0.1:")
    urllib.request.urlopen(address, timeout=60).close()  # it has begun to answer
    assert folder.is_dir(), "the folder was not made"
    process.send_signal(sent)
    _, err = process.communicate(timeout=60)
    assert process.returncode == code
    assert err.splitlines()[-1] == "itmo-video: the studio is closed"
    assert "Traceback" not in err


def test_a_file_is_no_folder(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    done = run("studio", CLIP, "--no-browser", "--folder", tmp_path / "file")
    assert done.returncode == 2
    assert "not a folder" in done.stderr


def test_connections_that_ask_nothing_keep_nobody_out(tmp_path: Path) -> None:
    with studio(CLIP, tmp_path) as address:
        port = int(address.split(":")[2].split("/")[0])
        silent = [socket.create_connection(("127.0.0.1", port), 60) for _ in range(150)]
        for connection in silent[::2]:
            connection.sendall(b"GET / HTTP/1.1\r\n")
        with urllib.request.urlopen(address + "api/state", timeout=60) as answer:
            assert answer.status == 200
        for connection in silent:
            with suppress(ConnectionResetError):
                assert connection.recv(1) == b"", "it is still open"
            connection.close()
