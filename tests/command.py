"""The command line as a separate process, for tests that kill it or take its disk away."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

from clips import REPOSITORY

from itmo_video.errors import InputError
from itmo_video.output.exr import read_exr

COMMAND = (sys.executable, "-W", "error", "-m", "itmo_video")
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(REPOSITORY)}

# A shell's background job is deaf to SIGINT, and so would be the commands that tests interrupt.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def start(
    *args: object, command: Iterable[str] = COMMAND, start_new_session: bool = False
) -> subprocess.Popen[str]:
    """Start it; standard output and error are pipes of text."""
    return subprocess.Popen(
        [*command, *map(str, args)],
        cwd=REPOSITORY,
        env=ENVIRONMENT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=start_new_session,
    )


def run(*args: object, command: Iterable[str] = COMMAND) -> subprocess.CompletedProcess[str]:
    """Run it to its end, a minute at most."""
    process = start(*args, command=command)
    try:
        out, err = process.communicate(timeout=60)
    finally:
        process.kill()
    return subprocess.CompletedProcess(process.args, process.returncode, out, err)


def wait_for_frames(process: subprocess.Popen[str], count: int) -> None:
    """Read the events of `--json` until `count` frames are done."""
    assert process.stdout is not None
    for line in process.stdout:
        count -= '"event": "frame"' in line
        if count <= 0:
            return


def temp_files(folder: Path) -> list[str]:
    """Names of the temporary files in a folder."""
    return sorted(name for name in os.listdir(folder) if name.endswith(".tmp"))


def broken_frames(folder: Path) -> list[str]:
    """Names of the frames that do not open whole."""
    broken = []
    for path in sorted(folder.glob("*.exr")):
        try:
            read_exr(path)
        except InputError:
            broken.append(path.name)
    return broken
