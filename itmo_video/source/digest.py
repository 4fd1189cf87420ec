"""The hash of a source's content, and a check that its files have not changed.

XXH3 with 128 bits (package xxhash) hashes 15 GB/s per core here, so the disk is the limit; BLAKE3
reaches 3, the standard library's SHA-256 1.5, or 0.4 without hardware support. It tells films
apart; it does not withstand deliberate collisions, which would harm only their maker.
"""

from __future__ import annotations

import os
import stat
import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import xxhash

from itmo_video.errors import InputError, ReplacedInputError
from itmo_video.regular_file import open_regular
from itmo_video.source import remembered
from itmo_video.source.read_faults import PROBED_BYTES, ReadFault, find_fault

_BLOCK = 4 << 20
_WORTH_REMEMBERING = 64 << 20  # bytes; smaller files are hashed faster than looked up
_SETTLED_S = 2.0  # newer files may change again within the resolution of their time stamp
_MOST_BYTES = 1 << 46  # larger than any film: a sparse file made to keep us busy


class Stamp(NamedTuple):
    """The values that change when a file is modified or replaced."""

    device: int
    inode: int
    size: int
    written_ns: int


class SourceFiles:
    """The files of a clip, in their state when it was opened.

    Some of a sequence may be missing or not be regular files; they are gaps. `faults` states by
    file where the disk failed during hashing; the content is then what came before.
    """

    def __init__(self, paths: Iterable[Path], most_bytes: int = _MOST_BYTES) -> None:
        """Files larger than `most_bytes` are gaps, too."""
        self._most_bytes = most_bytes
        self._stamps = {path: _stamp(path) for path in paths}
        self.faults: dict[Path, ReadFault] = {}

    def digest(self, scanned_bytes: int | None = None) -> str:
        """The hash (32 hex digits) of the content of all files, not of their names.

        A cached one counts only if what follows `scanned_bytes`, the end that a scan found, can be
        read. Raises DamagedInputError if a file changes meanwhile.
        """
        if len(self._stamps) == 1:
            (path,) = self._stamps
            found = file_digest(path, self.faults, scanned_bytes)
            self.check(path)
            return found
        together = xxhash.xxh3_128()
        for path, stamp in self._stamps.items():
            is_there = stamp is not None and stamp.size <= self._most_bytes
            together.update((file_digest(path, self.faults) if is_there else "missing").encode())
            self.check(path)
        return together.hexdigest()

    def change_of(self, path: Path) -> str | None:
        """What happened to `path`: "was removed", "changed", or None."""
        now = _stamp(path)
        if now == self._stamps[path]:
            return None
        return "was removed" if now is None else "changed"

    def check(self, path: Path) -> None:
        """Raise ReplacedInputError if `path` was removed or changed."""
        if (change := self.change_of(path)) is not None:
            raise ReplacedInputError(
                f"the file {change} while it was being read",
                where=os.fspath(path),
                remedy="Restore it, then run the same command again.",
            )


def content_digest(paths: Sequence[Path]) -> str:
    """The digest of these files in their present state; see SourceFiles."""
    return SourceFiles(paths).digest()


def file_digest(
    path: Path, faults: dict[Path, ReadFault] | None = None, scanned_bytes: int | None = None
) -> str:
    """The hash (32 hex digits) of a file's content; raises InputError if it cannot be opened.

    Where the disk fails it is of what came before, and of the failure, which is added to `faults`.
    Cached for large files, and recomputed when their size, times or inode change, or if what
    follows `scanned_bytes` cannot be read.
    """
    found = os.stat(path)
    is_settled = time.time() - max(found.st_mtime, found.st_ctime) > _SETTLED_S
    is_worth_it = found.st_size >= _WORTH_REMEMBERING and is_settled
    known = remembered.digest(path, found) if is_worth_it else None
    if known is not None and not (
        scanned_bytes is not None and find_fault(path, scanned_bytes, PROBED_BYTES)
    ):
        return known
    if found.st_size > _MOST_BYTES:
        raise InputError(f"has {found.st_size} bytes: too large for a film", where=os.fspath(path))
    content = xxhash.xxh3_128()
    block = bytearray(_BLOCK)
    view = memoryview(block)
    at = 0
    with open_regular(path) as file:
        try:
            # Unbuffered: what was read before a fault is not lost with it.
            while count := file.raw.readinto(block):  # type: ignore[attr-defined]
                content.update(view[:count])
                at += count
        except OSError as error:
            fault = ReadFault(at, error.strerror or str(error))
            content.update(f"{fault}".encode())
            if faults is not None:
                faults[path] = fault
            return content.hexdigest()
    if is_worth_it:
        remembered.remember(path, found, content.hexdigest())
    return content.hexdigest()


def _stamp(path: Path) -> Stamp | None:
    try:
        found = os.stat(path)
    except (OSError, ValueError):
        return None
    if not stat.S_ISREG(found.st_mode):
        return None
    return Stamp(found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns)
