"""Opening untrusted files safely: regular files only, with a size limit.

A pipe could block forever, and a device or a sparse file of terabytes could fill the memory.
"""

from __future__ import annotations

import os
import stat
from typing import BinaryIO

from itmo_video.errors import InputError

StrPath = str | os.PathLike[str]
TEXT_BYTES = 64 << 20  # of JSON and TOML: an analysis of ten hours takes 20 MB


def open_regular(path: StrPath) -> BinaryIO:
    """Open `path` for reading; raises InputError unless it is a readable regular file.

    FileNotFoundError and NotADirectoryError are its cause if there is no such file.
    """
    try:
        # A blocking open of a pipe without a writer would never return.
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | _BINARY)
    except (OSError, ValueError) as error:
        raise _unreadable(path, error) from error
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise InputError("is not a regular file", where=os.fspath(path))
    return os.fdopen(descriptor, "rb")


def read_regular(path: StrPath, most_bytes: int) -> bytes:
    """The content of `path`; raises InputError like open_regular, and above `most_bytes`."""
    with open_regular(path) as file:
        try:
            size = os.fstat(file.fileno()).st_size
            # Python allocates the requested size, so it must not exceed the file's.
            asked = min(most_bytes, size + (1 << 20)) + 1
            data = file.read(asked) if size <= most_bytes else b""
        except OSError as error:
            raise _unreadable(path, error) from error
    if max(size, len(data)) > most_bytes:
        raise InputError(
            f"has {size} bytes, more than the limit of {most_bytes}", where=os.fspath(path)
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
