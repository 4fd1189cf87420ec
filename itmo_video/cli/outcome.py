"""How a command ends: errors in two lines, exit codes."""

from __future__ import annotations

import os
import sys
import traceback

from itmo_video.errors import ItmoError


def reported(error: ItmoError) -> int:
    """Print an error; returns its exit code."""
    debug()
    print(f"itmo-video: {error}", file=sys.stderr)
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
