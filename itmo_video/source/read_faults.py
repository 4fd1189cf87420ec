"""Disks that fail while a source is read: where, and what is said of it."""

from __future__ import annotations

import os
from pathlib import Path
from typing import NamedTuple

from itmo_video.errors import DamagedInputError, InputError, ReplacedInputError
from itmo_video.regular_file import open_regular

PROBED_BYTES = 64 << 20  # read behind where packets end, to see whether the disk ended them
_BLOCK = 1 << 20


class ReadFault(NamedTuple):
    """A byte of a file that the disk does not give, and the system's words for why."""

    byte: int
    reason: str

    def __str__(self) -> str:
        return f"reading fails at byte {self.byte} ({self.reason})"


def find_fault(path: Path, start: int, most_bytes: int) -> ReadFault | None:
    """The first byte from `start` on that cannot be read, of `most_bytes`; None for none."""
    at, end = start, start + most_bytes
    try:
        with open_regular(path) as file:
            file.seek(start)
            while at < end and (count := len(file.read1(min(_BLOCK, end - at)))):  # type: ignore[attr-defined]
                at += count
    except OSError as error:
        return ReadFault(at, error.strerror or str(error))
    except InputError as error:
        return ReadFault(at, error.what)
    return None


def fault_at_ends(path: Path) -> ReadFault | None:
    """The first byte that cannot be read at a file's beginning or end, where its headers lie."""
    far = max(0, path.stat().st_size - PROBED_BYTES)
    return find_fault(path, 0, PROBED_BYTES) or find_fault(path, far, PROBED_BYTES)


class FailingDiskError(DamagedInputError):
    """The disk failed while the clip was opened, which ends there."""


def ends_at(path: Path, fault: ReadFault) -> FailingDiskError:
    """What is said of a clip that was known to end at a fault when it was opened."""
    return FailingDiskError(
        str(fault),
        where=os.fspath(path),
        remedy="Copy the file to a disk that can be read; what came before the fault was used.",
    )


def check_readable(path: Path, start: int, most_bytes: int) -> None:
    """Raise ReplacedInputError where the disk no longer gives what it gave before."""
    if (fault := find_fault(path, max(0, start), most_bytes)) is not None:
        raise ReplacedInputError(
            str(fault),
            where=os.fspath(path),
            remedy="Copy the file to a disk that can be read, then run the same command again.",
        )
