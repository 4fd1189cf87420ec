"""A converted folder opened for reading: settings by shot, files by frame, and its source.

Everything that reads a finished conversion (previews, reports, figures, side files) uses this
module, so that all read a folder in the same way.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from fractions import Fraction
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

from itmo_video.errors import InputError, OutputError, UsageError
from itmo_video.model import ASSUMED_SEQUENCE_RATE, Half
from itmo_video.output.exr import ExrImage, read_exr
from itmo_video.output.fingerprint import fingerprints_told
from itmo_video.output.folder import OutputFolder
from itmo_video.output.frame_form import FrameForm, colour_attributes
from itmo_video.output.manifest import MANIFEST_NAME, Manifest, read_manifest
from itmo_video.output.settings_changes import frames_changes
from itmo_video.settings import Settings, settings_from
from itmo_video.source.opening import Clip, input_options, open_clip
from itmo_video.words import frames_are

RATE_ASSUMED = f"the EXR files state no frame rate: assumed {ASSUMED_SEQUENCE_RATE} fps"


@dataclass(frozen=True)
class ConvertedShot:
    """Frames `first` to `last` (indices, inclusive) that were converted with their own settings.

    `told` is how these differ from the folder's, as in the manifest.
    """

    first: int
    last: int
    settings: Settings
    told: Mapping[str, Any] = field(default_factory=dict, repr=False)


@dataclass(frozen=True)
class Converted:
    """A folder's settings and files; `files` by number, rising, `shots` sorted by their frames.

    The file numbered `first_number` is the source's frame 0. `settings` apply to all frames outside
    of `shots`.
    """

    path: Path
    manifest: Manifest
    settings: Settings
    shots: tuple[ConvertedShot, ...]
    first_number: int
    files: Mapping[int, Path]

    @property
    def numbers(self) -> list[int]:
        """The numbers of the existing frames, rising."""
        return list(self.files)

    def index_of(self, number: int) -> int:
        """The index of the source frame that a file was converted from."""
        return number - self.first_number

    def settings_of(self, number: int) -> Settings:
        """The settings that a frame was converted with."""
        shot = self._shot_of(number)
        return self.settings if shot is None else shot.settings

    def read(self, number: int) -> ExrImage:
        """A frame's picture, after checking that the file really is this frame of the conversion.

        All readers use this. Raises KeyError for a missing number, InputError if the file is
        damaged, was modified, or belongs to another source, number or settings, and OutputError if
        it disappears.
        """
        path = self.files[number]
        try:
            image = read_exr(path)
        except InputError as error:
            if isinstance(error.__cause__, FileNotFoundError | NotADirectoryError):
                raise OutputError(
                    "the file disappeared while the folder was being read",
                    where=str(path),
                    remedy="Restore it or convert again, then run the same command again.",
                ) from error
            raise
        shot = self._shot_of(number)
        told = fingerprints_told(
            self.manifest.settings,
            {} if shot is None else shot.told,
            self.manifest.source_digest,
            self.index_of(number),
        )
        if image.fingerprint not in told:
            values = self.manifest.settings | ({} if shot is None else dict(shot.told))
            changed = frames_changes(str(image.attributes.get("itmoSettings")), values)
            what = (
                f"settings differ ({', '.join(changed)})"
                if changed
                else "source, number or version differ"
            )
            raise InputError(
                f"not a frame of this folder: its {what}",
                where=str(path),
                remedy="Convert with --update to render it again if only settings differ, or move "
                "it away; `convert --verify` names all such frames.",
            )
        size = image.size if number == next(iter(self.files)) else self.size
        alpha = "A" if "A" in image.channels else ""
        settings = self.settings_of(number)
        names = frozenset((*"RGB", *alpha, *(f"{name}.Y" for name in settings.layers)))
        told_of_colour = colour_attributes(settings)
        if not FrameForm(size, names, settings.compression, told_of_colour).is_of(image):
            raise InputError(
                "modified since it was converted: size, windows, channels, compression or colour "
                "space differ",
                where=str(path),
                remedy="Run the conversion again to re-render it.",
            )
        return image

    @property
    def absent(self) -> str | None:
        """The numbers of missing frames as ranges; None if there are none.

        If the manifest does not state the source's frame count, only gaps between files count.
        """
        numbers, count = self.numbers, self.manifest.source_frames
        first, end = self.first_number, self.first_number + (count or 0)
        if count is None and numbers:
            first, end = numbers[0], numbers[-1] + 1
        around = [first - 1, *(n for n in numbers if first <= n < end), end]
        # By their ends, as a forged count may be of any size.
        gaps = [(a + 1, b - 1) for a, b in pairwise(around) if b - a > 1]
        return ",".join(str(a) if a == b else f"{a}-{b}" for a, b in gaps) or None

    @property
    def notices(self) -> tuple[str, ...]:
        """Notices to report before the folder is shown."""
        return (f"{frames_are(self.absent)} not in the folder",) if self.absent else ()

    def _shot_of(self, number: int) -> ConvertedShot | None:
        index = self.index_of(number)
        own = (shot for shot in self.shots if shot.first <= index <= shot.last)
        return next(own, None)

    @property
    def white_nits(self) -> float:
        """The luminance of 1.0."""
        return self.settings.white_nits

    @property
    def peak_nits(self) -> float:
        """The highest peak of all shots."""
        return max(
            peak_nits_of(s) for s in (self.settings, *(shot.settings for shot in self.shots))
        )

    @cached_property
    def first_image(self) -> ExrImage:
        """The first frame; raises as `read`."""
        return self.read(self.numbers[0])

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in pixels."""
        return self.first_image.size

    @property
    def frame_rate(self) -> Fraction:
        """The frame rate, assumed if the files do not state it."""
        return self.first_image.frame_rate or ASSUMED_SEQUENCE_RATE

    @property
    def rate_notices(self) -> tuple[str, ...]:
        """A notice if the frame rate is assumed."""
        return () if self.first_image.frame_rate else (RATE_ASSUMED,)

    @property
    def pixel_aspect(self) -> Fraction:
        """The width of a pixel over its height."""
        stated = self.first_image.attributes.get("pixelAspectRatio", 1)
        if not (isinstance(stated, int | float) and 0.01 < stated < 100):
            return Fraction(1)
        return Fraction(str(stated)).limit_denominator(1000)

    def time_s(self, number: int, image: ExrImage) -> Fraction:
        """A frame's presentation time in seconds: its own, or by the frame rate."""
        stated: Any = image.attributes.get("itmoTime")
        return Fraction(stated) if stated is not None else self.index_of(number) / self.frame_rate

    def open_source(self, clip: Path, max_pixels: int) -> Clip:
        """The clip that the folder was converted from, read with the same settings.

        Raises InputError if it is another clip; frames have the folder's indices.
        """
        options = replace(input_options(self.settings, max_pixels), raw=None)  # this is a file
        opened = open_clip(clip, options)
        try:
            self.check_source(opened)
        except InputError:
            opened.close()
            raise
        return opened

    def check_source(self, clip: Clip) -> None:
        """Raise InputError unless the folder was converted from this clip, by its content."""
        if clip.info.digest == self.manifest.source_digest:
            return
        where = clip.info.path
        if clip.disk_fault is not None:
            raise InputError(clip.disk_fault, where=where, remedy="Copy it to another disk.")
        raise InputError(
            f"not the clip that the folder was converted from ({self.manifest.source_name!r})",
            where=where,
            remedy=f"Give that clip, or convert this: itmo-video convert {where} FOLDER",
        )


def peak_nits_of(settings: Settings) -> float:
    """The highest luminance that settings can produce."""
    return settings.l_max_effective * settings.white_nits


def open_converted(folder: Path) -> Converted:
    """Open a converted folder; raises InputError if it has no conversion or no frames."""
    found = find_converted(folder)
    if found is None:
        raise InputError(
            "not a converted folder",
            where=str(folder),
            remedy="Give a folder that convert wrote, a film, or an image sequence by its pattern, "
            "such as img.%04d.png.",
        )
    if not found.files:
        raise InputError(
            "contains no frames", where=str(folder), remedy="Run the conversion again."
        )
    return found


def find_converted(folder: Path) -> Converted | None:
    """A folder with a manifest, with or without frames; None for any other folder.

    Raises InputError if the manifest is invalid.
    """
    manifest = read_manifest(folder)
    if manifest is None:
        return None
    values = dict(manifest.settings)
    try:
        first, told = int(str(values.pop("first_number", 1))), values.pop("shots", [])
        # Ignore what a later version may have added.
        settings = settings_from(_known(values))
        shots = tuple(_shot(entry, settings) for entry in _sequence(told))
        output = OutputFolder(folder, manifest.stem)
    except (UsageError, ValueError, TypeError) as error:
        what = error.what if isinstance(error, UsageError) else str(error)
        raise InputError(
            f"the manifest is invalid: {what}",
            where=str(folder),
            remedy=f"Restore {MANIFEST_NAME}, or convert into another folder.",
        ) from error
    files = {number: output.frame_path(number) for number in output.frame_numbers()}
    return Converted(folder, manifest, settings, shots, first, files)


def rgb_of(image: ExrImage) -> tuple[Half, Half, Half]:
    """R, G and B of a converted frame, which `Converted.read` has checked."""
    return image.channels["R"], image.channels["G"], image.channels["B"]


def _known(values: Mapping[str, Any]) -> dict[str, Any]:
    names = {f.name for f in fields(Settings)}
    return {name: value for name, value in values.items() if name in names}


def _shot(entry: object, base: Settings) -> ConvertedShot:
    first, last, changed = _sequence(entry)
    if not isinstance(changed, Mapping):
        raise ValueError("the settings of a shot are not a table")
    settings = replace(base, **_known(changed))
    return ConvertedShot(int(str(first)), int(str(last)), settings, changed)


def _sequence(value: object) -> Sequence[object]:
    if not isinstance(value, list | tuple):
        raise ValueError("the shots are not a list")
    return value
