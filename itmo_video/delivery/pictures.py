"""Where previews get their pictures from: a clip converted on the fly, or a converted folder."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import repeat
from pathlib import Path
from typing import Any, TypeVar

import cv2
import numpy.typing as npt

from itmo_video import pipeline
from itmo_video.delivery.in_order import InOrder, run_in_order
from itmo_video.errors import InputError, UsageError
from itmo_video.exr import ExrImage, read_exr
from itmo_video.folder import Manifest, OutputFolder, read_manifest
from itmo_video.frame_ranges import format_ranges, parse_ranges
from itmo_video.look import make_look
from itmo_video.model import Float32, Frame, Half
from itmo_video.plan import RunOptions, input_options, make_plan
from itmo_video.reader import Clip, frames_at, open_clip
from itmo_video.render import Rendered
from itmo_video.settings import Settings

T = TypeVar("T")


@dataclass(frozen=True)
class Picture:
    """One finished frame: planar linear RGB, 1.0 = SDR white, and its source frame if known."""

    index: int
    number: int
    time_s: Fraction
    rgb: tuple[Half | Float32, Half | Float32, Half | Float32]
    source: Frame | None = None
    layers: Mapping[str, npt.NDArray[Any]] = field(default_factory=dict)


Work = Callable[[Picture], T]


@dataclass
class Pictures:
    """A film's pictures and what is said of all of them; `mapped` makes something of each.

    `damage` is filled while they are made: what was cut short or missing.
    """

    size: tuple[int, int]
    frame_rate: Fraction
    pixel_aspect: Fraction
    white_nits: float
    peak_nits: float
    primaries: str
    numbers: Sequence[int]
    clip: Path | None
    _mapped: Callable[[Callable[[Picture], Any]], Iterator[Any]]
    damage: list[str] = field(default_factory=list)

    def mapped(self, work: Work[T]) -> Iterator[T]:
        """`work` of each picture in presentation order; it runs in several threads at once."""
        return self._mapped(work)


def from_clip(source: Path, settings: Settings, run: RunOptions) -> Pictures:
    """The pictures of a clip, converted on the fly; raises what `convert` would."""
    look = make_look(settings)
    with open_clip(source, input_options(settings, run.max_pixels)) as clip:
        plan = make_plan(clip, look, run)
    by_index = {index: number for number, index in plan.numbers.items()}
    info = plan.clip
    pictures: Pictures

    def mapped(work: Work[T]) -> Iterator[T]:
        def make(buffer: InOrder[T]) -> None:
            made = 0

            def sink(frame: Frame, done: Rendered) -> None:
                nonlocal made
                made += 1
                number = by_index[frame.index]
                item = work(
                    Picture(frame.index, number, frame.time_s, done.rgb, frame, done.layers)
                )
                buffer.put(frame.index, item)

            wanted = sorted(by_index)
            ended = pipeline.render_frames(
                clip, wanted, look, plan.jobs, sink, on_planned=buffer.plan, on_stop=buffer.close
            )
            pictures.damage += [error.what for error in ended]
            if made < len(wanted):
                pictures.damage.append(f"{len(wanted) - made} frames could not be decoded")

        return run_in_order(make, plan.jobs * (settings.key_reach + 1))

    pictures = Pictures(
        info.display_size, info.frame_rate, info.pixel_aspect, settings.white_nits,
        settings.l_max_effective * settings.white_nits, settings.primaries,
        sorted(plan.numbers), source, mapped,
    )  # fmt: skip
    return pictures


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
        jobs = run.jobs or pipeline.default_jobs()
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
