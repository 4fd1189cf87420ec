"""EXR sequences, by the source frame that each file belongs to, and their pictures.

Pictures are linear BT.709 RGB, SDR white = 1, float32 (H, W, 3): the primaries of measurements.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np

from itmo_video.colour import linear_light
from itmo_video.colour.primaries import rgb_to_rgb_matrix
from itmo_video.conversion.frame_ranges import format_ranges
from itmo_video.errors import InputError
from itmo_video.model import Float32, Frame
from itmo_video.output.converted import Converted, find_converted
from itmo_video.output.exr import ExrImage, read_exr
from itmo_video.settings import Settings, settings_from
from itmo_video.source.files import MAX_PIXELS
from itmo_video.source.opening import Clip, input_options, open_clip
from itmo_video.words import frames_are

PRIMARIES = "rec709"


@dataclass(frozen=True)
class ExrSequence:
    """A folder's EXR files by number; `made` has what its manifest says, if there is one.

    The file with `first_number` belongs to the source's frame 0; in a folder without a manifest
    that is the lowest number.
    """

    path: Path
    files: Mapping[int, Path]
    first_number: int
    made: Converted | None

    @property
    def settings(self) -> Settings | None:
        """The settings it was made with, if there is a manifest."""
        return None if self.made is None else self.made.settings

    @property
    def notices(self) -> tuple[str, ...]:
        """What should be reported first."""
        return () if self.made is None else self.made.notices

    @property
    def by_index(self) -> dict[int, Path]:
        """The files by index of their source frames, in ascending order."""
        return {number - self.first_number: file for number, file in self.files.items()}

    @property
    def settings_or_default(self) -> Settings:
        """The settings it was made with, or the defaults."""
        return self.settings or Settings()

    def read(self, number: int, part: str | None = None) -> ExrImage:
        """A file, or a part of it; raises InputError unless it is complete and belongs here."""
        if self.made is not None and part in (None, "0"):
            return self.made.read(number)
        return read_exr(self.files[number], part)

    def rgb(self, number: int, part: str | None = None) -> Float32:
        """`exr_rgb` of what `read` returns."""
        return exr_rgb(self.read(number, part), self.files[number])


@dataclass(frozen=True)
class Pair:
    """A file and its truth, by sequence and number, and the index of their source frame.

    `part` is the part of the truth's file to read; None for the first picture in it.
    """

    index: int
    number: int
    true_number: int
    sequences: tuple[ExrSequence, ExrSequence]
    part: str | None = None

    @property
    def test(self) -> Path:
        """The file."""
        return self.sequences[0].files[self.number]

    @property
    def truth(self) -> Path:
        """The truth's file."""
        return self.sequences[1].files[self.true_number]

    def rgb(self) -> Float32:
        """The picture."""
        return self.sequences[0].rgb(self.number)

    def true_rgb(self) -> Float32:
        """The truth's picture."""
        return self.sequences[1].rgb(self.true_number, self.part)


def open_sequence(folder: Path) -> ExrSequence:
    """The EXR files of a folder; InputError if there are none or the manifest is invalid."""
    made = find_converted(folder)
    if made is not None:
        files, first = made.files, made.first_number
    else:
        files = _numbered(sorted(folder.glob("*.exr")))
        first = min(files, default=0)
    if not files:
        raise InputError("contains no EXR files", where=str(folder))
    return ExrSequence(folder, files, first, made)


def _numbered(paths: Sequence[Path]) -> dict[int, Path]:
    """Files by the last number in their names; counted from 0 unless all numbers differ.

    `paths` are sorted by name.
    """
    numbers = [re.search(r"(\d+)\D*$", path.stem) for path in paths]
    found = [int(match[1]) for match in numbers if match is not None]
    if len(set(found)) < len(paths):
        return dict(enumerate(paths))
    return dict(sorted(zip(found, paths, strict=True)))


def pair(test: ExrSequence, truth: ExrSequence, part: str | None = None) -> list[Pair]:
    """Each file of `test` with its truth, by the index of the source frame.

    Numbers are matched instead if the truth has no manifest and the same numbers, or if neither has
    a manifest and the truth has all the test's numbers. InputError for frames without a truth.
    """
    numbers, true_numbers = set(test.files), set(truth.files)
    is_same = truth.settings is None and numbers == true_numbers
    is_part = truth.settings is None and test.settings is None and numbers <= true_numbers
    if is_same or is_part:
        start = (test if test.settings is not None else truth).first_number
        return [Pair(n - start, n, n, (test, truth), part) for n in sorted(numbers)]
    between = truth.first_number - test.first_number
    if missing := [n for n in sorted(numbers) if n + between not in truth.files]:
        raise InputError(
            f"{frames_are(format_ranges(missing))} not in the reference", where=str(test.path)
        )
    start = test.first_number
    return [Pair(n - start, n, n + between, (test, truth), part) for n in sorted(numbers)]


def open_source(source: Path, sequence: ExrSequence | None, max_pixels: int = MAX_PIXELS) -> Clip:
    """The SDR clip, read as by the sequence's conversion, even if it is tagged as HDR.

    Raises InputError if the sequence was made from another clip.
    """
    settings = Settings() if sequence is None else sequence.settings_or_default
    values = {**settings.as_dict(), "force_sdr": True, "raw": None}
    clip = open_clip(source, input_options(settings_from(values), max_pixels))
    if sequence is not None and sequence.made is not None:
        sequence.made.check_source(clip)
    return clip


def frame_rgb(frame: Frame) -> Float32:
    """The picture of an SDR frame, in [0, 1] before primaries are converted."""
    planes = linear_light.to_rgb_linear(frame, clip=True)
    return _to_bt709(np.dstack(planes), frame.encoding.primaries)


def exr_rgb(image: ExrImage, where: Path) -> Float32:
    """The picture of an EXR file; raises InputError if R, G or B is missing."""
    if missing := [name for name in "RGB" if name not in image.channels]:
        raise InputError(f"has no channel {', '.join(missing)}", where=str(where))
    planes = [image.shown(name).astype(np.float32) for name in "RGB"]
    return _to_bt709(np.dstack(planes), image.primaries)


def read_rgb(path: Path, part: str | None = None) -> Float32:
    """`exr_rgb` of a file, or of a part of it; raises InputError unless it is complete."""
    return exr_rgb(read_exr(path, part), path)


def frame_rate(test: ExrSequence, clip: Clip | None) -> Fraction | None:
    """Frames per second: the files' own, or the clip's, or None."""
    stated = test.read(next(iter(test.files))).frame_rate
    return stated or (clip.info.frame_rate if clip is not None else None)


def _to_bt709(rgb: Float32, primaries: str) -> Float32:
    if primaries == PRIMARIES:
        return rgb
    matrix = rgb_to_rgb_matrix(primaries, PRIMARIES)
    return np.asarray(rgb @ matrix.T.astype(np.float32), np.float32)
