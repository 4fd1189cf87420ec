"""Still images and numbered sequences as clips."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

from itmo_video.errors import DamagedInputError, InputError
from itmo_video.model import ASSUMED_SEQUENCE_RATE, ClipInfo, Frame
from itmo_video.source import still_colour
from itmo_video.source.clip import Clip
from itmo_video.source.digest import SourceFiles
from itmo_video.source.files import PICTURE_BYTES, check_file
from itmo_video.source.planes import upright
from itmo_video.source.still_picture import StillPicture
from itmo_video.source.still_reading import kind_of, read_still
from itmo_video.source.tags import InputOptions
from itmo_video.words import missing

_LONGEST = 10_000_000  # frames of a sequence, including gaps: 100 hours
NUMBER_PATTERN = re.compile(r"%0?(\d*)d|#+")


def is_pattern(path: Path) -> bool:
    """Whether the name is the pattern of a sequence: `img.%04d.png`, `img.####.png`."""
    return NUMBER_PATTERN.search(path.name) is not None


class StillClip(Clip):
    """Images by index; each is read with its own tags and bit depth, as encoders vary them.

    A damaged image is a gap, and `faults` says why, by index. An image whose size differs from the
    first, or that has alpha if the first has none, ends the clip.
    """

    def __init__(self, path: Path, files: dict[int, Path], options: InputOptions) -> None:
        self._path, self._files, self._options = path, dict(sorted(files.items())), options
        self.faults = self._faults = dict[int, str]()
        self._source = SourceFiles(self._files.values(), PICTURE_BYTES)
        self._first = min(files)
        self._rate = Fraction(options.fps or ASSUMED_SEQUENCE_RATE)
        self._is_single = list(files.values()) == [path]
        found = next(filter(None, (self._read(n, file) for n, file in self._files.items())), None)
        if found is None:
            reason = next(iter(self.faults.values()))
            raise InputError(f"none of its images can be decoded: {reason}", where=str(path))
        frame, picture, told = found
        self._ahead = {self._first + frame.index: found}  # for the first reader
        self._alpha, self._size = frame.encoding.has_alpha, frame.size
        count = max(self._files) - self._first + 1
        if count > _LONGEST:
            raise InputError(
                f"the numbers of this sequence span {count} frames, more than {_LONGEST}",
                where=str(path),
                remedy="Move files with unrelated numbers to another folder.",
            )
        notices = [*picture.notices, *told]
        turn = picture.turn
        if turn != (0, False):
            notices.append(
                f"rotated for display: {'mirrored, then ' * turn[1]}{turn[0]} degrees clockwise"
            )
        if not self._is_single and options.fps is None:
            notices.append(f"images have no frame rate: assumed {self._rate} (set it with --fps)")
        if len(files) < count:
            gaps = sorted(set(range(self._first, self._first + count)) - set(self._files))
            named = ", ".join(map(str, gaps[:8])) + ", ..." * (len(gaps) > 8)
            notices.append(f"{missing(len(gaps), 'frame')} from the sequence: {named}")
        width, height = picture.size
        stem, number = _own_number(path) if self._is_single else (_sequence_stem(path), self._first)
        self.info = ClipInfo(
            path=str(path),
            stem=stem,
            container="image" if self._is_single else "image sequence",
            codec=picture.codec,
            pixel_format=picture.form,
            width=width,
            height=height,
            frames=count,
            frame_rate=self._rate,
            duration_s=count / self._rate,
            is_vfr=False,
            pixel_aspect=Fraction(1),
            rotation_deg=turn[0],
            flip=turn[1],
            field_order="progressive",
            timecode=None,
            encoding=frame.encoding,
            digest=self._source.digest(),
            first_number=number,
            notices=tuple(notices),
        )

    def frames(self, start: int = 0) -> Iterator[Frame]:
        """Yield the images that decode, from index `start` on."""
        for number, file in self._files.items():
            if number - self._first < start:
                continue
            self._source.check(file)
            found = self._ahead.pop(number, None) or self._read(number, file)
            self._source.check(file)  # ensures that what was read is what was hashed
            if found is None:
                continue
            frame = found[0]
            if frame.size != self._size or frame.encoding.has_alpha != self._alpha:
                raise DamagedInputError(
                    f"{frame.size[0]}x{frame.size[1]} differs from the first image, "
                    f"{self.info.display_size[0]}x{self.info.display_size[1]}, "
                    "in size or in having alpha",
                    where=str(file),
                    remedy="Images before it can be converted; move the others to another folder.",
                )
            yield frame

    def time_s(self, index: int) -> Fraction:
        """The presentation time at the rate set, or assumed."""
        return index / self._rate

    def _read(self, number: int, file: Path) -> tuple[Frame, StillPicture, tuple[str, ...]] | None:
        """One image as a frame, with its decoded picture; None if it cannot be decoded."""
        index = number - self._first
        try:
            check_file(file)
            kind = kind_of(file)
            if kind is None:
                raise InputError("not an image in a supported format", where=str(file))
            picture = read_still(file, kind, self._options.max_pixels)
        except InputError as error:
            if self._is_single:
                raise
            self._faults[index] = f"{file.name}: {error.what}"
            return None
        except DamagedInputError as error:
            if self._is_single:
                raise InputError(f"cannot be decoded: {error.what}", where=str(file)) from error
            self._faults[index] = f"{file.name}: {error.what}"
            return None
        done, encoding, told = still_colour.resolve(picture, self._options, str(file))
        planes, encoding = upright(done.planes, picture.turn, encoding)
        return Frame(index, index / self._rate, planes, encoding), picture, told


def sequence(path: Path) -> dict[int, Path]:
    """The files that match a pattern, by number; InputError if there are none."""
    match = NUMBER_PATTERN.search(path.name)
    assert match is not None
    digits = int(match[1] or 1) if match[0].startswith("%") else len(match[0])
    before, after = (
        re.escape(path.name[part]) for part in (slice(match.start()), slice(match.end(), None))
    )
    name = re.compile(f"{before}([0-9]{{{digits},}}){after}", re.DOTALL)
    files: dict[int, Path] = {}
    try:
        entries = os.listdir(path.parent)
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", where=str(path.parent)) from error
    for entry in entries:
        found = name.fullmatch(entry)
        if found and (len(found[1]) == digits or found[1][0] != "0"):
            files[int(found[1])] = path.parent / entry
    if not files:
        raise InputError("no file matches this pattern", where=str(path))
    return files


def _own_number(path: Path) -> tuple[str, int | None]:
    """The stem and number of a single picture: `img.0007.png` is number 7 of `img`."""
    match = re.fullmatch(r"(.+)\.([0-9]{1,9})", path.stem, re.DOTALL)
    return (match[1], int(match[2])) if match else (path.stem, None)


def _sequence_stem(path: Path) -> str:
    match = NUMBER_PATTERN.search(path.name)
    stem = path.name[: match.start()] if match else path.stem
    return stem.rstrip("._- ") or path.parent.name or "frame"
