"""EXR sequences by the source frame that each file belongs to, and the pictures in them.

Pictures are linear BT.709 RGB, SDR white = 1, float32 (H, W, 3): the primaries of measurements.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from itmo_video.colour import linear_light
from itmo_video.colour.primaries import rgb_to_rgb_matrix
from itmo_video.conversion.frame_ranges import format_ranges
from itmo_video.errors import InputError
from itmo_video.model import Float32, Frame
from itmo_video.output.converted import find_converted
from itmo_video.output.exr import ExrImage, read_exr
from itmo_video.settings import Settings, settings_from
from itmo_video.source.opening import Clip, input_options, open_clip

PRIMARIES = "rec709"


@dataclass(frozen=True)
class ExrSequence:
    """A folder's EXR files by number; `settings` and the numbering's start where a manifest is.

    The file with `first_number` belongs to the source's frame 0. In a folder that no conversion
    made, that is taken to be the lowest number there.
    """

    path: Path
    files: Mapping[int, Path]
    first_number: int
    settings: Settings | None

    @property
    def by_index(self) -> dict[int, Path]:
        """The files by index of their source frames, rising."""
        return {number - self.first_number: file for number, file in self.files.items()}

    @property
    def settings_or_default(self) -> Settings:
        """What it was made with, as far as is known."""
        return self.settings or Settings()


@dataclass(frozen=True)
class Pair:
    """A file, its truth, the index of their source frame, and the number in the file's name.

    `part` is the part of the truth's file that is meant, None for the first picture in it.
    """

    index: int
    number: int
    test: Path
    truth: Path
    part: str | None = None

    def true_rgb(self) -> Float32:
        """The truth's picture."""
        return read_rgb(self.truth, self.part)


def open_sequence(folder: Path) -> ExrSequence:
    """The EXR files of a folder; InputError where there are none or their manifest is not valid."""
    made = find_converted(folder)
    if made is not None:
        files, first, settings = made.files, made.first_number, made.settings
    else:
        files, settings = _numbered(sorted(folder.glob("*.exr"))), None
        first = min(files, default=0)
    if not files:
        raise InputError("no EXR files in it", where=str(folder))
    return ExrSequence(folder, files, first, settings)


def _numbered(paths: Sequence[Path]) -> dict[int, Path]:
    """Files by the last number in their names; counted from 0 where not all have one of their own.

    `paths` are sorted by name.
    """
    numbers = [re.search(r"(\d+)\D*$", path.stem) for path in paths]
    found = [int(match[1]) for match in numbers if match is not None]
    if len(set(found)) < len(paths):
        return dict(enumerate(paths))
    return dict(sorted(zip(found, paths, strict=True)))


def pair(test: ExrSequence, truth: ExrSequence, part: str | None = None) -> list[Pair]:
    """Each file of `test` with its truth, by the index of the source frame.

    Where the truth has no manifest and the very same numbers, or neither has one and the truth has
    all the test's numbers, the numbers count. Raises InputError for frames without a truth.
    """
    numbers, true_numbers = set(test.files), set(truth.files)
    is_same = truth.settings is None and numbers == true_numbers
    is_part = truth.settings is None and test.settings is None and numbers <= true_numbers
    if is_same or is_part:
        start = (test if test.settings is not None else truth).first_number
        return [Pair(n - start, n, test.files[n], truth.files[n], part) for n in sorted(numbers)]
    truths = truth.by_index
    if missing := [n for n in sorted(numbers) if n - test.first_number not in truths]:
        raise InputError(
            f"frames {format_ranges(missing)} are not in the reference", where=str(test.path)
        )
    start = test.first_number
    return [Pair(n - start, n, test.files[n], truths[n - start], part) for n in sorted(numbers)]


def open_source(source: Path, settings: Settings) -> Clip:
    """The SDR clip, read as a conversion with `settings` reads it; a clip tagged HDR is, too."""
    values = {**settings.as_dict(), "force_sdr": True}
    return open_clip(source, input_options(settings_from(values)))


def frame_rgb(frame: Frame) -> Float32:
    """The picture of an SDR frame, in [0, 1] before primaries are changed."""
    planes = linear_light.to_rgb_linear(frame, clip=True)
    return _to_bt709(np.dstack(planes), frame.encoding.primaries)


def exr_rgb(image: ExrImage, where: Path) -> Float32:
    """The picture of an EXR file; raises InputError where R, G or B is missing."""
    if missing := [name for name in "RGB" if name not in image.channels]:
        raise InputError(f"it has no channel {', '.join(missing)}", where=str(where))
    planes = [image.shown(name).astype(np.float32) for name in "RGB"]
    return _to_bt709(np.dstack(planes), image.primaries)


def read_rgb(path: Path, part: str | None = None) -> Float32:
    """`exr_rgb` of a file, or of a part of it; raises InputError unless it is whole."""
    return exr_rgb(read_exr(path, part), path)


def frame_rate(test: ExrSequence, clip: Clip | None) -> Fraction:
    """Frames a second: the files' own, or the clip's, or 24."""
    first = read_exr(next(iter(test.files.values())))
    stated: Any = first.attributes.get("framesPerSecond")
    if stated:
        return Fraction(stated)
    return clip.info.frame_rate if clip is not None else Fraction(24)


def _to_bt709(rgb: Float32, primaries: str) -> Float32:
    if primaries == PRIMARIES:
        return rgb
    matrix = rgb_to_rgb_matrix(primaries, PRIMARIES)
    return np.asarray(rgb @ matrix.T.astype(np.float32), np.float32)
