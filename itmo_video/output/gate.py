"""The gate through which all single files are written: checks existing files first.

A command's inputs are never overwritten; another file only on request, and only if it is of the
kind that is written. Checked before any work (`check`), and again when the finished file gets its
name (`put`).
"""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from itmo_video.errors import InputError, OutputError
from itmo_video.output.atomic import (
    RUN_AGAIN,
    output_error,
    sweep_temp_files,
    temp_path,
    write_whole,
)
from itmo_video.regular_file import StrPath, open_regular
from itmo_video.source.digest import content_digest

_HEAD_BYTES = 4096
_NO_LINKS = (errno.EPERM, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK, errno.EXDEV)
PAGE_MARK = b'<meta name="generator" content="itmo-video">'


@dataclass(frozen=True)
class Kind:
    """A kind of file, recognised by its first bytes; `word` is its name for the user."""

    word: str
    begins: Callable[[bytes], bool]


def _is_film(head: bytes) -> bool:
    boxes = (b"ftyp", b"moov", b"mdat", b"free", b"skip", b"wide")
    return head[4:8] in boxes or head.startswith((b"\x1a\x45\xdf\xa3", b"YUV4MPEG2 "))


def _is_still(head: bytes) -> bool:
    begins = (b"\x89PNG\r\n", b"\xff\xd8\xff", b"II*\0", b"MM\0*")
    return head.startswith(begins) or head[4:12] == b"ftypavif"


FILM = Kind("film", _is_film)
STILL = Kind("picture", _is_still)
PAGE = Kind("report", lambda head: PAGE_MARK in head)
DYNAMIC_METADATA = Kind(
    "dynamic metadata", lambda head: b'"JSONInfo"' in head or b'"level6"' in head
)
EDIT_LIST = Kind(
    "edit list", lambda head: b'"OTIO_SCHEMA"' in head or head.lstrip().startswith(b"TITLE:")
)
ANALYSIS = Kind("analysis", lambda head: b'"itmo_video_analysis"' in head)


class Gate:
    """A file to be written to `path`, and what must not be overwritten.

    `inputs` are the files that the command reads. `source_digest` is the hash of the film that a
    folder was converted from, which may be anywhere. `is_ours` allows replacing a file of this kind
    without being asked, for kinds that only we write.
    """

    def __init__(
        self,
        path: StrPath,
        kind: Kind,
        *,
        inputs: Iterable[StrPath] = (),
        overwrite: bool = False,
        source_digest: str | None = None,
        is_ours: bool = False,
    ) -> None:
        self.path = Path(path)
        self._kind, self._digest = kind, source_digest
        self._overwrite, self._replaces = overwrite, overwrite or is_ours
        self._inputs = {_identity(file) for file in inputs} - {None}

    def check(self) -> None:
        """Raise OutputError if the file may not be written; cleans up after killed runs."""
        sweep_temp_files(self.path.parent)
        if os.path.lexists(self.path):
            self._check_present()
        elif not self.path.parent.is_dir():
            raise self._refused("the folder does not exist", "Create it, or choose another.")

    def put(self, temp: Path) -> None:
        """Rename the finished file `temp`, next to `path`; raises OutputError like `check`."""
        try:
            if not os.path.lexists(self.path):
                if _is_linked(temp, self.path):
                    return
                if os.path.lexists(self.path):
                    self._check_present()
            else:
                self._check_present()
            os.replace(temp, self.path)
        except OSError as error:
            raise output_error(error, self.path, RUN_AGAIN) from error

    def write(self, data: bytes) -> int:
        """Write `data` atomically via a temporary file; returns the size in bytes."""
        temp = temp_path(self.path.absolute())
        try:
            try:
                size = write_whole(temp, data)
            except OutputError as error:  # of the file that is wanted, not of its temporary name
                error = OutputError(error.what, where=os.fspath(self.path), remedy=error.remedy)
                raise error from None
            self.put(temp)
        finally:
            with suppress(OSError):
                temp.unlink()
        return size

    def _check_present(self) -> None:
        if _identity(self.path) in self._inputs:
            raise self._refused("it is an input of this command", "Choose another name.")
        try:
            mode = os.stat(self.path).st_mode
            if not stat.S_ISREG(mode):
                what = "a folder" if stat.S_ISDIR(mode) else "not a regular file"
                raise self._refused(f"it is {what}", "Choose another name.")
            with open_regular(self.path) as file:
                head = file.read(_HEAD_BYTES)
            is_source = self._digest is not None and content_digest([self.path]) == self._digest
        except FileNotFoundError as error:
            raise self._refused("it is a broken link", "Choose another name.") from error
        except (OSError, InputError) as error:
            raise self._refused(
                "a file of this name exists and cannot be read", "Choose another name."
            ) from error
        if is_source:
            raise self._refused("it is the source of this folder", "Choose another name.")
        if head and not self._kind.begins(head):
            raise self._refused(
                f"a file exists there, but no {self._kind.word}", "Choose another name."
            )
        if not self._replaces or (not head and not self._overwrite):
            raise self._refused("file exists", "Choose another name, or use --overwrite.")

    def _refused(self, what: str, remedy: str) -> OutputError:
        return OutputError(f"not written: {what}", where=os.fspath(self.path), remedy=remedy)


def _identity(path: StrPath) -> tuple[int, int] | None:
    """The identity of a file, independent of links and upper or lower case."""
    try:
        found = os.stat(path)
    except (OSError, ValueError):
        return None
    return found.st_dev, found.st_ino


def _is_linked(temp: Path, path: Path) -> bool:
    """Rename `temp` to `path` unless it exists by now; a plain rename would replace it."""
    if os.name == "nt":
        return False
    try:
        os.link(temp, path)
    except FileExistsError:
        return False
    except OSError as error:
        if error.errno in _NO_LINKS:
            return False
        raise
    temp.unlink()
    return True
