"""Handling standard streams that are closed, full, or no longer read."""

from __future__ import annotations

import errno
import os
import sys
from contextlib import suppress
from typing import Any, TextIO, cast

_LOST = (errno.EPIPE, errno.ENOSPC, errno.EBADF, errno.EIO)


class _Unlosable:
    """Standard error without errors: failing to print must not stop the work."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        with suppress(OSError, ValueError):
            return self._stream.write(text)
        return len(text)

    def flush(self) -> None:
        with suppress(OSError, ValueError):
            self._stream.flush()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def with_streams() -> None:
    """Make sure that standard output and error exist, and that printing to the latter never fails.

    A closed stream (`2>&-`) would be None, and its descriptor would go to the next file opened.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            try:
                os.fstat(number)
            except OSError:
                os.open(os.devnull, os.O_RDWR)  # takes the lowest free number
            stream = open(os.devnull, "r" if number == 0 else "w", encoding="utf-8")  # noqa: SIM115 - stays open
            setattr(sys, name, stream)
    if sys.stderr is sys.__stderr__ and not isinstance(sys.stderr, _Unlosable):
        sys.stderr = cast(TextIO, _Unlosable(cast(TextIO, sys.stderr)))


def lost_output(error: OSError) -> int | None:
    """The exit code if standard output was lost; None if the error has another cause.

    A reader that stops early (`| head`) is not a failure, 0; a full disk is 5.
    """
    if error.errno not in _LOST or error.filename is not None:
        return None
    with suppress(OSError, ValueError):  # otherwise the interpreter retries on exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    if error.errno == errno.EPIPE:
        return 0
    print(
        f"itmo-video: standard output cannot be written ({error.strerror})\n"
        "Free some space or choose another place, then run the same command to resume.",
        file=sys.stderr,
    )
    return 5
