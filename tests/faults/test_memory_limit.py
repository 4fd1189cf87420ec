"""A limit of memory: the last words are ours, and a lack of memory does not pass for damage."""

from __future__ import annotations

import errno
import signal
import subprocess
import sys
from typing import Any

import av
import pytest
from command import ENVIRONMENT

from itmo_video import memory_limit
from itmo_video.source.decoding import decode_all

pytestmark = pytest.mark.skipif(not hasattr(signal, "sigwaitinfo"), reason="needs Linux")

GUARDED = """
import os, resource, sys, time
from itmo_video.cli.memory_guard import guarded
resource.setrlimit(resource.RLIMIT_AS, (8 << 30, resource.RLIM_INFINITY))
def main():
    {body}
sys.exit(guarded(main))
"""


def start(body: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", GUARDED.format(body=body)],
        env=ENVIRONMENT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


@pytest.mark.parametrize("body", ["os.abort()", "os._exit(127)", "os._exit(1)"])
def test_a_library_that_ends_the_process_is_reported_with_the_limit(body: str) -> None:
    process = start(body)
    _, told = process.communicate(timeout=60)
    assert process.returncode == 1
    assert told.splitlines()[-2] == "itmo-video: not enough memory; finished frames are intact"
    assert "8590 MB (ulimit -v" in told.splitlines()[-1]


@pytest.mark.parametrize(("body", "code"), [("return 4", 4), ("return 0", 0), ("sys.exit(2)", 2)])
def test_the_exit_code_is_that_of_the_command(body: str, code: int) -> None:
    process = start(body)
    assert process.communicate(timeout=60) == ("", "")
    assert process.returncode == code


def test_a_signal_reaches_the_command() -> None:
    body = (
        "import signal\n    signal.signal(signal.SIGTERM, lambda *told: sys.exit(143))\n"
        "    print('ready', flush=True)\n    time.sleep(60)"
    )
    with start(body) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        process.send_signal(signal.SIGTERM)
        assert process.wait(timeout=50) == 143


def test_a_lack_of_memory_is_no_damage(monkeypatch: pytest.MonkeyPatch) -> None:
    class Poor:
        def decode(self, packet: Any) -> list[Any]:
            av.error.err_check(-errno.ENOMEM)
            return []

    assert list(decode_all(Poor(), iter(()), "a.mkv")) == [], "the file claims too much"
    monkeypatch.setattr(memory_limit, "memory_limit", lambda: 1 << 30)
    with pytest.raises(MemoryError):
        list(decode_all(Poor(), iter(()), "a.mkv"))
