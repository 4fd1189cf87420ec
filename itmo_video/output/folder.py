"""The folder that one clip's frames go to: its owner, its content, what can be cleared away.

One JSON manifest names the source and the settings; each frame carries its own fingerprint. Several
processes, on several machines, may work in one folder at the same time: nothing here locks, every
file appears whole by a rename, and the manifest is created by exactly one of them.
"""

from __future__ import annotations

import errno
import json
import os
import re
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import Literal

from itmo_video.errors import InputError, OutputError
from itmo_video.output.atomic import (
    StrPath,
    output_error,
    sweep_temp_files,
    temp_path,
    write_whole,
)
from itmo_video.output.exr import read_exr
from itmo_video.output.frame_form import FrameForm
from itmo_video.output.manifest import MANIFEST_NAME, Manifest, read_manifest

FrameState = Literal["missing", "whole", "damaged", "other"]

Forms = Callable[[int], FrameForm | None]  # of frames by number

_PROBLEMS: dict[FrameState, str] = {
    "missing": "missing",
    "damaged": "damaged; run the same command again to re-render it",
    "other": "made with other settings or from another source; --update re-renders it",
}


class OutputFolder:
    """One clip's output folder. Making the object touches nothing on the disk.

    `stem` begins each frame's name, `digits` is the least number of digits in it. Raises ValueError
    for a stem that cannot begin a file name.
    """

    def __init__(self, path: StrPath, stem: str, digits: int = 4) -> None:
        if not stem or any(mark in stem for mark in ("/", "\0", os.sep)):
            raise ValueError(f"{stem!r} cannot begin a file name")
        self.path = Path(path)
        self.stem = stem
        self.digits = digits

    @property
    def manifest_path(self) -> Path:
        """Where the manifest lies."""
        return self.path / MANIFEST_NAME

    def frame_path(self, number: int) -> Path:
        """Name the file of frame `number`, counted as in the file names, from 0 up."""
        if number < 0:
            raise ValueError(f"frame number {number} is negative")
        return self.path / f"{self.stem}.{number:0{self.digits}d}.exr"

    def frame_numbers(self) -> list[int]:
        """List the numbers of the frames that are there, whole or not, in rising order."""
        pattern = re.compile(re.escape(self.stem) + rf"\.(\d{{{self.digits},}})\.exr", re.ASCII)
        matches = [match for match in map(pattern.fullmatch, self._names()) if match]
        # "clip.00007.exr" is no frame of ours: 7 has four digits.
        return sorted(int(m[1]) for m in matches if self.frame_path(int(m[1])).name == m[0])

    def is_nobodys(self) -> bool:
        """Whether files lie in it, names with a leading dot apart, and none is a manifest."""
        names = self._names()
        return MANIFEST_NAME not in names and any(name[0] != "." for name in names)

    def check(self, manifest: Manifest, *, overwrite: bool = False, update: bool = False) -> None:
        """Raise OutputError where `claim` would refuse the folder; writes nothing."""
        self._plan(manifest, overwrite, update)

    def claim(self, manifest: Manifest, *, overwrite: bool = False, update: bool = False) -> None:
        """Make the folder this conversion's: create it and its manifest, or join in.

        Any number of processes may claim it at once with the same manifest. No file but the
        manifest is touched: frames of before stay until they are made again. Raises OutputError
        for another's or nobody's files unless `overwrite` is given, for this source's with other
        settings unless `overwrite` or `update` is, and when nothing can be written there.
        """
        try:
            self.path.mkdir(parents=True, exist_ok=True)
        except FileExistsError as error:
            raise OutputError(
                "it is a file, not a folder", where=str(self.path), remedy="Choose another name."
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
                error.what, where=error.where, remedy="Choose another folder, or --overwrite."
            ) from error
        if present is None:
            if overwrite or not self.is_nobodys():
                return "create"
            if os.path.exists(self.manifest_path):  # another process has claimed it just now
                return self._plan(manifest, overwrite, update)
            raise OutputError(
                "the folder holds files that are not from a conversion",
                where=str(self.path),
                remedy="Choose an empty or new folder, or --overwrite to write among them.",
            )
        wanted = Manifest.from_json(manifest.to_json())  # tuples become lists, as in the file
        if present == wanted:
            return "join"
        if overwrite:
            return "replace"
        _refuse_another(present, wanted, str(self.path))
        changed = _differences(present.settings, wanted.settings)
        if changed and not update:
            raise OutputError(
                f"the folder was made with other settings ({', '.join(changed)})",
                where=str(self.path),
                remedy="--update re-renders the frames that change, --overwrite all of them;"
                " or choose another folder.",
            )
        return "replace" if changed else "join"  # a source that was only renamed is the same

    def state(self, number: int, fingerprint: str, form: FrameForm | None = None) -> FrameState:
        """Tell what is there of a frame: it counts as whole only if all its channels can be read.

        A whole file with another `fingerprint`, or none, is "other". One with the fingerprint whose
        windows, channels or compression are not of the `form` was tampered with: "damaged".
        """
        path = self.frame_path(number)
        if not os.path.lexists(path):
            return "missing"
        try:
            image = read_exr(path)
        except InputError:
            # Removed or being renamed meanwhile is not damage.
            return "damaged" if os.path.lexists(path) else "missing"
        if image.fingerprint != fingerprint:
            return "other"
        return "whole" if form is None or form.is_of(image) else "damaged"

    def states(
        self, fingerprints: Mapping[int, str], jobs: int = 1, forms: Forms = lambda number: None
    ) -> dict[int, FrameState]:
        """Tell the `state` of each frame, looking at `jobs` of them at a time."""
        states: dict[int, FrameState] = {}
        numbers = iter(sorted(fingerprints))
        with ThreadPoolExecutor(jobs, thread_name_prefix="look") as pool:
            # In batches: a film has more frames than should wait in a pool, and Ctrl-C must work.
            while batch := list(islice(numbers, 16 * jobs)):
                found = pool.map(lambda n: self.state(n, fingerprints[n], forms(n)), batch)
                states.update(zip(batch, found, strict=True))
        return states

    def verify(
        self, fingerprints: Mapping[int, str], jobs: int = 1, forms: Forms = lambda number: None
    ) -> list[tuple[Path, str]]:
        """Check frames by number against their fingerprints; return (path, problem) for each fault.

        The manifest is checked too. An empty list means that all is as it should be.
        """
        faults: list[tuple[Path, str]] = []
        try:
            if read_manifest(self.path) is None:
                faults.append((self.manifest_path, "missing"))
        except InputError as error:
            faults.append((self.manifest_path, error.what))
        for number, state in self.states(fingerprints, jobs, forms).items():
            if state != "whole":
                faults.append((self.frame_path(number), _PROBLEMS[state]))
        return faults

    def sweep_temp_files(self) -> int:
        """Remove what dead processes of this machine left; see atomic.sweep_temp_files."""
        return sweep_temp_files(self.path)

    def _names(self) -> list[str]:
        try:
            return os.listdir(self.path)
        except FileNotFoundError:
            return []
        except OSError as error:
            raise output_error(error, self.path) from error

    def _create_manifest(self, data: bytes) -> bool:
        """Create the manifest, whole at once; False when another process was first."""
        temp = temp_path(self.manifest_path)
        write_whole(temp, data, durable=True)
        try:
            # A rename would replace what another process has just made; a link cannot.
            (os.rename if os.name == "nt" else os.link)(temp, self.manifest_path)
        except FileExistsError:
            return False
        except OSError as error:
            if error.errno not in (errno.EPERM, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK):
                raise output_error(error, self.manifest_path) from error
            write_whole(self.manifest_path, data, durable=True)  # a file system without links
        finally:
            with suppress(OSError):
                temp.unlink()
        return True


def _refuse_another(present: Manifest, wanted: Manifest, where: str) -> None:
    if present.source_digest != wanted.source_digest:
        what = f"the folder holds the frames of another source, {present.source_name!r}"
    elif present.stem != wanted.stem:
        what = f"the folder holds this source's frames already, named {present.stem!r}"
    else:
        return
    raise OutputError(what, where=where, remedy="Choose another folder, or --overwrite.")


def _differences(old: Mapping[str, object], new: Mapping[str, object]) -> list[str]:
    def show(values: Mapping[str, object], name: str) -> str:
        value = values.get(name)
        if isinstance(value, float):
            return f"{value:.6g}"
        return json.dumps(value, sort_keys=True) if name in values else "unset"

    # Folders of before it was recorded are told by their frames' fingerprints.
    names = sorted((old.keys() | new.keys()) - ({"algorithm"} - old.keys()))
    pairs = ((name, show(old, name), show(new, name)) for name in names)
    changed = [
        _shots_changed(old, new)
        if name == "shots"
        else f"{name.replace('_', '-')} {was[:40]} -> {now[:40]}"
        for name, was, now in pairs
        if was != now
    ]
    return [*changed[:4], f"and {len(changed) - 4} more"] if len(changed) > 4 else changed


def _shots_changed(old: Mapping[str, object], new: Mapping[str, object]) -> str:
    """Which frames' shots differ, by the numbers of their files."""
    first, rows = new.get("first_number", 1), list[str]()
    both = [
        {json.dumps(shot): shot for shot in shots} if isinstance(shots, list) else {}
        for shots in (old.get("shots", []), new.get("shots", []))
    ]
    for text in sorted(both[0].keys() ^ both[1].keys()):
        match both[0].get(text, both[1].get(text)), first:
            case [int(begin), int(end), _], int(start):
                rows.append(f"{begin + start}-{end + start}")
    told = sorted(set(rows), key=lambda text: int(text.split("-")[0]))
    more = f" and {len(told) - 3} more" if len(told) > 3 else ""
    return f"shots of frames {', '.join(told[:3])}{more}"
