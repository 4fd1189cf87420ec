"""A preview's pictures from a converted folder."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction
from itertools import repeat
from pathlib import Path

import cv2

from itmo_video.conversion.frame_ranges import format_ranges, parse_ranges
from itmo_video.conversion.plan import RunOptions
from itmo_video.delivery.pictures import Picture, Pictures, T, Work
from itmo_video.errors import InputError, UsageError
from itmo_video.model import Frame, Half
from itmo_video.output.exr import ExrImage, read_exr
from itmo_video.output.folder import Manifest, OutputFolder, read_manifest
from itmo_video.rendering import spans
from itmo_video.settings import Settings
from itmo_video.source.opening import Clip, frames_at, input_options, open_clip


def from_folder(
    folder: Path, clip: Path | None, run: RunOptions, settings: Settings | None = None
) -> Pictures:
    """The pictures of a converted folder, read in order; `clip` is its source where it is needed.

    Raises InputError where no conversion's manifest or no frame is there.
    """
    manifest = read_manifest(folder)
    if manifest is None:
        raise InputError(
            "no conversion's folder", where=str(folder), remedy="Convert a clip first."
        )
    files = OutputFolder(folder, manifest.stem)
    numbers = files.frame_numbers()
    if run.frames is not None:
        asked = parse_ranges(run.frames)
        if outside := sorted(set(asked) - set(numbers)):
            raise UsageError(f"frames {format_ranges(outside)} are not there", where=str(folder))
        numbers = sorted(asked)
    if not numbers:
        raise InputError("there is no frame in it", where=str(folder))
    first = read_exr(files.frame_path(numbers[0]))
    made = manifest.settings
    white = _number(first.attributes.get("whiteLuminance"), _number(made.get("white_nits"), 203.0))
    peak = white * _number(made.get("l_max"), 1000 / 203)
    rate = Fraction(first.attributes.get("framesPerSecond") or 25)
    first_number = int(_number(made.get("first_number"), 1))
    aspect = Fraction(str(first.attributes.get("pixelAspectRatio", 1))).limit_denominator(1000)
    source = _same_source(clip, manifest, settings) if clip is not None else None

    def mapped(work: Work[T]) -> Iterator[T]:
        cv2.setNumThreads(1)
        jobs = run.jobs or spans.default_jobs()
        originals: Iterable[Frame | None] = repeat(None)
        if source is not None:
            originals = frames_at(source, [n - first_number for n in numbers])

        def make(number: int, original: Frame | None) -> T:
            image = read_exr(files.frame_path(number))
            at = image.attributes.get("itmoTime")
            time_s = Fraction(at) if at is not None else Fraction(number - first_number) / rate
            layers = {name: image.channels[name] for name in image.channels if "." in name}
            index = number - first_number
            return work(Picture(index, number, time_s, rgb_of(image), original, layers))

        with ThreadPoolExecutor(jobs, thread_name_prefix="exr") as pool:
            waiting = []
            for number, original in zip(numbers, originals, strict=False):
                waiting.append(pool.submit(make, number, original))
                if len(waiting) > 2 * jobs:
                    yield waiting.pop(0).result()
            for future in waiting:
                yield future.result()

    return Pictures(first.size, rate, aspect, white, peak, first.primaries, numbers, clip, mapped)


def rgb_of(image: ExrImage) -> tuple[Half, Half, Half]:
    """R, G and B of an EXR file; raises InputError where one is missing."""
    try:
        return image.channels["R"], image.channels["G"], image.channels["B"]
    except KeyError as error:
        raise InputError(f"the EXR file has no channel {error}") from error


def _same_source(clip: Path, manifest: Manifest, settings: Settings | None) -> Clip:
    """The opened clip; raises InputError unless it is what the folder was made of."""
    options = input_options(settings or Settings())
    opened = open_clip(clip, options)
    if opened.info.digest != manifest.source_digest:
        raise InputError(
            f"not the clip that the folder was made of ({manifest.source_name!r})", where=str(clip)
        )
    return opened


def _number(value: object, otherwise: float) -> float:
    return float(value) if isinstance(value, int | float) else otherwise
