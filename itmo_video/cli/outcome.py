"""The end of a command: error messages and exit codes."""

from __future__ import annotations

import os
import re
import sys
import traceback
from collections.abc import Sequence

from itmo_video.cli.log_file import LogFile
from itmo_video.cli.memory_guard import out_of_memory
from itmo_video.cli.terminal import named
from itmo_video.errors import ItmoError


class Terminated(BaseException):
    """SIGTERM was received."""


# How OpenCV, the C and C++ libraries, the loader and Python's threads report a lack of memory.
_OF_MEMORY = re.compile(
    r"insufficient memory|bad_alloc|cannot allocate memory|failed to map segment|"
    r"can't start new thread",
    re.IGNORECASE,
)


def reported(error: ItmoError, log: LogFile | None = None) -> int:
    """Print an error, and log it; returns its exit code."""
    debug()
    print(named(error, sys.stderr, "red"), file=sys.stderr)
    if log is not None:
        log.write(error)
    return error.exit_code


def debug() -> None:
    """Print the traceback if ITMO_VIDEO_DEBUG is set."""
    if os.environ.get("ITMO_VIDEO_DEBUG") == "1":
        traceback.print_exc()


def interrupted(code: int, said: Sequence[str]) -> int:
    """Report that the run was interrupted, and which output is intact; returns `code`."""
    stands = (
        "finished frames are intact, run the same command to resume"
        if said[:1] == ["convert"]
        else "a file that was not finished has not been written"
    )
    print(f"itmo-video: interrupted; {stands}", file=sys.stderr)
    return code


def unexpected(error: Exception) -> int:
    """Report a bug; returns the exit code."""
    debug()
    if _OF_MEMORY.search(str(error)):
        return out_of_memory()
    print(
        f"itmo-video: unexpected error: {type(error).__name__}: {error}\n"
        "Please report this; ITMO_VIDEO_DEBUG=1 prints the traceback.",
        file=sys.stderr,
    )
    return 1
