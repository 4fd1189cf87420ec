"""The log file of `--log`: a command's messages with times; runs are appended."""

from __future__ import annotations

import os
import re
import shlex
import stat
import sys
import threading
from collections.abc import Sequence
from contextlib import suppress
from datetime import UTC, datetime

from itmo_video.errors import OutputError
from itmo_video.output.atomic import output_error
from itmo_video.regular_file import StrPath

_TIME = "%Y-%m-%dT%H:%M:%S"
_OURS = re.compile(rb"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z ")


class LogFile:
    """Appends lines with times (UTC) to a log; raises OutputError for any other kind of file.

    Later write errors are reported once and do not stop the work.
    """

    def __init__(self, path: StrPath) -> None:
        self._path, self._lost = os.fspath(path), False
        self._lock = threading.Lock()
        try:
            flags = os.O_RDWR | os.O_APPEND | os.O_CREAT | getattr(os, "O_NONBLOCK", 0)
            descriptor = os.open(path, flags, 0o666)
        except OSError as error:
            raise output_error(error, path) from error
        try:
            if not stat.S_ISREG(os.fstat(descriptor).st_mode):
                raise _refused("not a regular file", self._path)
            head = os.read(descriptor, 64)
            if head and not _OURS.match(head):
                raise _refused("a file exists there that is not a log of itmo-video", self._path)
        except BaseException:
            os.close(descriptor)
            raise
        self._descriptor = descriptor

    def close(self) -> None:
        """Close the file."""
        with suppress(OSError):
            os.close(self._descriptor)

    def began(self, argv: Sequence[str]) -> None:
        """The first line of a run: the version and the command."""
        from importlib.metadata import version

        self.write(f"itmo-video {version('itmo_video')}: {shlex.join(argv)}")

    def write(self, message: object) -> None:
        """Append a message; each of its lines becomes a line of the log."""
        now = datetime.now(UTC)
        at = f"{now.strftime(_TIME)}.{now.microsecond // 1000:03d}Z"
        text = "".join(f"{at} {line}\n" for line in str(message).splitlines())
        left = memoryview(text.encode("utf-8", "backslashreplace"))
        with self._lock:
            try:
                while left and not self._lost:
                    left = left[os.write(self._descriptor, left) :]
            except OSError as error:
                self._lost = True
                print(
                    f"itmo-video: {self._path}: the log cannot be written ({error.strerror})",
                    file=sys.stderr,
                )


def _refused(what: str, path: str) -> OutputError:
    return OutputError(f"not written: {what}", where=path, remedy="Choose another name.")
