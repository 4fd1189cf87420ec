"""Files that others made, opened with care: regular ones only, and no more of them than expected.

A pipe would keep us waiting, a device or a sparse file of terabytes would fill the memory.
"""

from __future__ import annotations

import os
import stat
from typing import BinaryIO

from itmo_video.errors import InputError

StrPath = str | os.PathLike[str]
TEXT_BYTES = 64 << 20  # of JSON and TOML: an analysis of ten hours takes 20 MB


def open_regular(path: StrPath) -> BinaryIO:
    """Open `path` to be read; raises InputError unless it is a regular file that can be read.

    FileNotFoundError and NotADirectoryError are its cause where there is none.
    """
    try:
        # A pipe that nobody writes to would keep a blocking open waiting.
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | _BINARY)
    except (OSError, ValueError) as error:
        raise _unreadable(path, error) from error
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise InputError("is not a regular file", where=os.fspath(path))
    return os.fdopen(descriptor, "rb")


def read_regular(path: StrPath, most_bytes: int) -> bytes:
    """The content of `path`; raises InputError as open_regular, and above `most_bytes`."""
    with open_regular(path) as file:
        try:
            size = os.fstat(file.fileno()).st_size
            # Python takes memory for all that is asked for, so no more is than is there.
            asked = min(most_bytes, size + (1 << 20)) + 1
            data = file.read(asked) if size <= most_bytes else b""
        except OSError as error:
            raise _unreadable(path, error) from error
    if max(size, len(data)) > most_bytes:
        raise InputError(
            f"has {size} bytes, more than the {most_bytes} that it may have", where=os.fspath(path)
        )
    return data


def read_head(path: StrPath, count: int) -> bytes:
    """The first bytes of `path`; raises InputError as open_regular, and where reading fails."""
    with open_regular(path) as file:
        try:
            return file.read(count)
        except OSError as error:
            raise _unreadable(path, error) from error


_BINARY: int = getattr(os, "O_BINARY", 0)


def _unreadable(path: StrPath, error: Exception) -> InputError:
    if isinstance(error, FileNotFoundError):
        return InputError("no such file", where=os.fspath(path))
    reason = getattr(error, "strerror", None) or str(error)
    return InputError(f"cannot be read: {reason}", where=os.fspath(path))
