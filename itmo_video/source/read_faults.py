"""Disks that fail while a source is read: finds and reports where."""

from __future__ import annotations

import os
from pathlib import Path
from typing import NamedTuple

from itmo_video.errors import DamagedInputError, InputError, ReplacedInputError
from itmo_video.regular_file import open_regular

PROBED_BYTES = 64 << 20  # read beyond the last packet, to see whether the disk ended the file
_BLOCK = 1 << 20


class ReadFault(NamedTuple):
    """The byte of a file at which reading fails, and the system's reason."""

    byte: int
    reason: str

    def __str__(self) -> str:
        return f"reading fails at byte {self.byte} ({self.reason})"


def find_fault(path: Path, start: int, most_bytes: int) -> ReadFault | None:
    """The first of `most_bytes` from `start` on that cannot be read; None if all can."""
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
    """The first unreadable byte at a file's beginning or end, where its headers are."""
    far = max(0, path.stat().st_size - PROBED_BYTES)
    return find_fault(path, 0, PROBED_BYTES) or find_fault(path, far, PROBED_BYTES)


class FailingDiskError(DamagedInputError):
    """The disk failed while the clip was opened; the clip ends there."""


def ends_at(path: Path, fault: ReadFault) -> FailingDiskError:
    """The error for a clip that was found to end at a fault when it was opened."""
    return FailingDiskError(
        str(fault),
        where=os.fspath(path),
        remedy="Copy the file to a working disk; frames before the fault were used.",
    )


def check_readable(path: Path, start: int, most_bytes: int) -> None:
    """Raise ReplacedInputError if the disk can no longer read what it read before."""
    if (fault := find_fault(path, max(0, start), most_bytes)) is not None:
        raise ReplacedInputError(
            str(fault),
            where=os.fspath(path),
            remedy="Copy the file to a working disk, then run the same command again.",
        )
