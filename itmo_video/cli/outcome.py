"""How a command ends: errors in two lines, exit codes."""

from __future__ import annotations

import os
import sys
import traceback

from itmo_video.cli.log_file import LogFile
from itmo_video.cli.terminal import named
from itmo_video.errors import ItmoError


def reported(error: ItmoError, log: LogFile | None = None) -> int:
    """Print an error, and log it; returns its exit code."""
    debug()
    print(named(error, sys.stderr, "red"), file=sys.stderr)
    if log is not None:
        log.write(error)
    return error.exit_code


def debug() -> None:
    """Print the traceback where ITMO_VIDEO_DEBUG asks for it."""
    if os.environ.get("ITMO_VIDEO_DEBUG") == "1":
        traceback.print_exc()


def interrupted(code: int) -> int:
    """Say that the run was interrupted; returns `code`."""
    print(
        "itmo-video: interrupted; what is written is whole, the same command goes on",
        file=sys.stderr,
    )
    return code


def out_of_memory() -> int:
    """Say that memory ran out; returns the exit code."""
    debug()
    print(
        "itmo-video: there is not enough memory; what is written is whole\n"
        "Fewer --jobs, or a smaller --map-width, take less; a limit may be set (ulimit -v).",
        file=sys.stderr,
    )
    return 1


def unexpected(error: Exception) -> int:
    """Report what is our own fault; returns the exit code."""
    if type(error).__name__ == "error" and "Insufficient memory" in str(error):  # OpenCV's
        return out_of_memory()
    debug()
    print(
        f"itmo-video: unexpected: {type(error).__name__}: {error}\n"
        "Please report it; ITMO_VIDEO_DEBUG=1 shows where.",
        file=sys.stderr,
    )
    return 1
