"""A preview's pictures from a converted folder."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import repeat
from pathlib import Path

from itmo_video.conversion.frame_ranges import format_ranges, parse_ranges
from itmo_video.conversion.run_options import RunOptions
from itmo_video.delivery.pictures import Picture, Pictures, T, Work
from itmo_video.errors import UsageError
from itmo_video.model import Frame
from itmo_video.output.converted import Converted, rgb_of
from itmo_video.rendering import spans
from itmo_video.rendering.opencv_threads import single_opencv_thread
from itmo_video.source.opening import frames_at
from itmo_video.words import frames_are


def from_folder(folder: Converted, clip: Path | None, run: RunOptions) -> Pictures:
    """The pictures of a converted folder, read in order; `clip` is its source, if needed.

    Raises InputError if it is another clip, UsageError for missing frames.
    """
    numbers = folder.numbers
    if run.frames is not None:
        asked = parse_ranges(run.frames)
        if outside := sorted(set(asked) - set(numbers)):
            raise UsageError(
                f"{frames_are(format_ranges(outside))} not in the folder", where=str(folder.path)
            )
        numbers = sorted(asked)
    source = folder.open_source(clip, run.max_pixels) if clip is not None else None

    pictures: Pictures

    def mapped(work: Work[T]) -> Iterator[T]:
        jobs = run.jobs or spans.default_jobs()
        originals: Iterable[Frame | None] = repeat(None)
        if source is not None:
            originals = frames_at(source, [folder.index_of(n) for n in numbers])

        def make(number: int, original: Frame | None) -> T:
            image = folder.read(number)
            if image.is_source_damaged:
                pictures.damaged.add(number)
            layers = {name: image.channels[name] for name in image.channels if "." in name}
            index, time_s = folder.index_of(number), folder.time_s(number, image)
            alpha = image.channels.get("A")
            return work(Picture(index, number, time_s, rgb_of(image), original, layers, alpha))

        with single_opencv_thread(), ThreadPoolExecutor(jobs, thread_name_prefix="exr") as pool:
            waiting = []
            for number, original in zip(numbers, originals, strict=False):
                waiting.append(pool.submit(make, number, original))
                if len(waiting) > 2 * jobs:
                    yield waiting.pop(0).result()
            for future in waiting:
                yield future.result()

    pictures = Pictures(
        folder.size, folder.frame_rate, folder.pixel_aspect, folder.white_nits, folder.peak_nits,
        folder.first_image.primaries, numbers, clip, mapped,
        notices=(*(folder.notices if run.frames is None else ()), *folder.rate_notices),
    )  # fmt: skip
    return pictures
