"""The output folder of a clip's frames: its manifest, its content, and cleaning up.

One JSON manifest names the source and the settings; each frame has its own fingerprint. Several
processes, on several machines, may work in one folder at the same time without locks: every file
appears by an atomic rename, and exactly one process creates the manifest.
"""

from __future__ import annotations

import errno
import os
import re
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import Literal, TypeVar

from itmo_video.errors import InputError, OutputError
from itmo_video.output.atomic import (
    output_error,
    sweep_temp_files,
    temp_path,
    write_whole,
)
from itmo_video.output.exr import read_exr
from itmo_video.output.exr_fingerprint import stated_fingerprint
from itmo_video.output.frame_form import FrameForm
from itmo_video.output.manifest import MANIFEST_NAME, Manifest, read_manifest
from itmo_video.output.settings_changes import settings_changes
from itmo_video.regular_file import StrPath

FrameState = Literal["missing", "whole", "concealed", "damaged", "other"]

_T = TypeVar("_T")
_NUMBERED = re.compile(r".+\.\d{4,}\.exr", re.DOTALL | re.ASCII)

Forms = Callable[[int], FrameForm | None]  # of frames by number

_PROBLEMS: dict[FrameState, str] = {
    "missing": "missing",
    "damaged": "damaged",
    "other": "rendered with other settings (--update re-renders) or from another source "
    "(--overwrite)",
}


class OutputFolder:
    """One clip's output folder. Creating the object does not access the disk.

    `stem` starts each frame's name, `digits` is the minimum number of digits in it. Raises
    ValueError for a stem that cannot start a file name.
    """

    def __init__(self, path: StrPath, stem: str, digits: int = 4) -> None:
        if not stem or any(mark in stem for mark in ("/", "\0", os.sep)):
            raise ValueError(f"{stem!r} cannot begin a file name")
        self.path = Path(path)
        self.stem = stem
        self.digits = digits

    @property
    def manifest_path(self) -> Path:
        """The path of the manifest."""
        return self.path / MANIFEST_NAME

    def frame_path(self, number: int) -> Path:
        """The file of frame `number`, as in file names, 0 or more."""
        if number < 0:
            raise ValueError(f"frame number {number} is negative")
        return self.path / f"{self.stem}.{number:0{self.digits}d}.exr"

    def frame_numbers(self) -> list[int]:
        """The numbers of existing frames, intact or not, in rising order."""
        return self._numbers_in(self._names())

    def _numbers_in(self, names: Iterable[str]) -> list[int]:
        pattern = re.compile(re.escape(self.stem) + rf"\.(\d{{{self.digits},}})\.exr", re.ASCII)
        matches = [match for match in map(pattern.fullmatch, names) if match]
        # "clip.00007.exr" is not ours: 7 is written with four digits.
        return sorted(int(m[1]) for m in matches if self.frame_path(int(m[1])).name == m[0])

    def is_nobodys(self) -> bool:
        """Whether it has files (other than dot files) but no manifest."""
        names = self._names()
        return MANIFEST_NAME not in names and any(name[0] != "." for name in names)

    def check(self, manifest: Manifest, *, overwrite: bool = False, update: bool = False) -> None:
        """Raise OutputError if `claim` would refuse the folder; writes nothing."""
        self._plan(manifest, overwrite, update)

    def claim(self, manifest: Manifest, *, overwrite: bool = False, update: bool = False) -> None:
        """Claim the folder for this conversion: create it and its manifest, or join.

        Any number of processes may claim it at once with the same manifest. Only the manifest is
        written: older frames stay until they are re-rendered. Raises OutputError for another
        conversion's or unrelated files without `overwrite`, for other settings of this source
        without `overwrite` or `update`, and if the folder cannot be written.
        """
        try:
            self.path.mkdir(parents=True, exist_ok=True)
        except FileExistsError as error:
            raise OutputError(
                "is a file, not a folder", where=str(self.path), remedy="Choose another name."
            ) from error
        except OSError as error:
            raise output_error(error, self.path) from error
        data = manifest.to_json().encode()
        while (plan := self._plan(manifest, overwrite, update)) != "join":
            if plan == "replace":
                write_whole(self.manifest_path, data, durable=True)
                return
            if self._create_manifest(data):
                return

    def _plan(
        self, manifest: Manifest, overwrite: bool, update: bool
    ) -> Literal["create", "replace", "join"]:
        try:
            present = read_manifest(self.path)
        except InputError as error:
            if overwrite:
                return "replace"
            raise OutputError(
                error.what, where=error.where, remedy="Choose another folder, or use --overwrite."
            ) from error
        if present is None:
            if overwrite or not self.is_nobodys():
                return "create"
            if os.path.exists(self.manifest_path):  # another process has just claimed it
                return self._plan(manifest, overwrite, update)
            raise OutputError(
                "the folder contains files that are not from a conversion",
                where=str(self.path),
                remedy="Choose an empty or new folder, or use --overwrite to write among them.",
            )
        wanted = Manifest.from_json(manifest.to_json())  # tuples become lists, as in the file
        if present == wanted:
            return "join"
        if overwrite:
            return "replace"
        _refuse_another(present, wanted, str(self.path))
        changed = settings_changes(present.settings, wanted.settings)
        if changed and not update:
            raise OutputError(
                f"the folder was converted with other settings ({', '.join(changed)})",
                where=str(self.path),
                remedy="Use --update to re-render the frames that change, --overwrite for all; "
                "or choose another folder.",
            )
        return "replace" if changed else "join"  # a renamed source is still the same

    def state(self, number: int, fingerprint: str, form: FrameForm | None = None) -> FrameState:
        """The state of a frame, which is intact only if all its channels can be read.

        An intact file with another `fingerprint`, or none, is "other". One with the fingerprint but
        with windows, channels or compression that differ from `form` was modified: "damaged".
        An intact one is "concealed" where its source frame was damaged.
        """
        path = self.frame_path(number)
        if not os.path.lexists(path):
            return "missing"
        try:
            image = read_exr(path)
        except InputError:
            # Being removed or renamed meanwhile is not damage.
            return "damaged" if os.path.lexists(path) else "missing"
        if image.fingerprint != fingerprint:
            return "other"
        if form is not None and not form.is_of(image):
            return "damaged"
        return "concealed" if image.is_source_damaged else "whole"

    def states(
        self, fingerprints: Mapping[int, str], jobs: int = 1, forms: Forms = lambda number: None
    ) -> dict[int, FrameState]:
        """The `state` of each frame, checking `jobs` of them at a time."""
        return _looked_at(fingerprints, jobs, lambda n: self.state(n, fingerprints[n], forms(n)))

    def fingerprints(self, numbers: Iterable[int], jobs: int = 1) -> dict[int, str | None]:
        """What frames state of themselves, by their headers; see exr_fingerprint."""
        return _looked_at(numbers, jobs, lambda n: stated_fingerprint(self.frame_path(n)))

    def other_frames(self) -> list[str]:
        """The names of EXR files that are numbered like ours but belong to another stem."""
        names = self._names()
        ours = {self.frame_path(number).name for number in self._numbers_in(names)}
        return sorted(n for n in names if _NUMBERED.fullmatch(n) and n not in ours)

    def verify(
        self, fingerprints: Mapping[int, str], jobs: int = 1, forms: Forms = lambda number: None
    ) -> list[tuple[Path, str]]:
        """Check frames by number against their fingerprints; return (path, problem) for each fault.

        The manifest is checked, too. An empty list means that everything is intact.
        """
        faults: list[tuple[Path, str]] = []
        try:
            if read_manifest(self.path) is None:
                faults.append((self.manifest_path, "missing"))
        except InputError as error:
            faults.append((self.manifest_path, error.what))
        for number, state in self.states(fingerprints, jobs, forms).items():
            if state not in ("whole", "concealed"):
                faults.append((self.frame_path(number), _PROBLEMS[state]))
        return faults

    def sweep_temp_files(self) -> int:
        """Remove leftovers of dead processes; see atomic.sweep_temp_files."""
        return sweep_temp_files(self.path)

    def _names(self) -> list[str]:
        try:
            return os.listdir(self.path)
        except FileNotFoundError:
            return []
        except OSError as error:
            raise output_error(error, self.path) from error

    def _create_manifest(self, data: bytes) -> bool:
        """Create the manifest atomically; False if another process was first."""
        temp = temp_path(self.manifest_path)
        write_whole(temp, data, durable=True)
        try:
            # A rename would replace another process's new manifest; a link cannot.
            (os.rename if os.name == "nt" else os.link)(temp, self.manifest_path)
        except FileExistsError:
            return False
        except OSError as error:
            if error.errno not in (errno.EPERM, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK):
                raise output_error(error, self.manifest_path) from error
            write_whole(self.manifest_path, data, durable=True)  # the file system has no links
        finally:
            with suppress(OSError):
                temp.unlink()
        return True


def _looked_at(numbers: Iterable[int], jobs: int, look: Callable[[int], _T]) -> dict[int, _T]:
    """What `look` finds of each number, rising, `jobs` of them at a time."""
    found: dict[int, _T] = {}
    rest = iter(sorted(numbers))
    with ThreadPoolExecutor(jobs, thread_name_prefix="look") as pool:
        # In batches, so that the pool's queue stays short and Ctrl-C works.
        while batch := list(islice(rest, 16 * jobs)):
            found.update(zip(batch, pool.map(look, batch), strict=True))
    return found


def _refuse_another(present: Manifest, wanted: Manifest, where: str) -> None:
    if present.source_digest != wanted.source_digest:
        what = f"the folder contains the frames of another source, {present.source_name!r}"
    elif present.stem != wanted.stem:
        what = f"the folder already contains this source's frames, named {present.stem!r}"
    else:
        return
    raise OutputError(what, where=where, remedy="Choose another folder, or use --overwrite.")
