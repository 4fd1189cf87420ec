"""Arrays in, HDR arrays out: one picture, or a stream with the map carried along motion."""

from __future__ import annotations

import sys
from collections import deque
from collections.abc import Generator, Iterable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from itmo_video.arrays.array_frames import ArrayFrames
from itmo_video.conversion.run_options import RunOptions
from itmo_video.errors import UsageError
from itmo_video.look import Look, make_look
from itmo_video.model import Half, Primaries
from itmo_video.motion.cut_detection import Analysed
from itmo_video.motion.keyframes import Span
from itmo_video.presets import as_settings
from itmo_video.rendering import spans
from itmo_video.rendering.opencv_threads import single_opencv_thread
from itmo_video.settings import Settings


@dataclass(frozen=True, eq=False)
class Expanded:
    """One HDR picture, and the settings it was made with.

    `rgb` is linear light, float16 (H, W, 3), in the primaries that `settings` name; 1.0 is SDR
    white, `settings.white_nits` cd/m2. `layers` are planes (H, W) by name, those of
    `settings.layers`: expand_map, gain, clip_mask. `index` counts the source's pictures from 0.

    >>> import numpy as np
    >>> from itmo_video import expand
    >>> hdr = expand(np.full((32, 32, 3), 128, np.uint8))
    >>> hdr.index, hdr.rgb.shape, hdr.settings.white_nits, hdr.alpha
    (0, (32, 32, 3), 203.0, None)
    """

    index: int
    rgb: Half
    layers: Mapping[str, npt.NDArray[Any]]
    settings: Settings
    alpha: Half | None = None


def expand(
    rgb: npt.NDArray[Any],
    settings: Settings | str | None = None,
    *,
    primaries: Primaries = "rec709",
    bit_depth: int | None = None,
) -> Expanded:
    """Expand one SDR picture, as `convert` does a still; `expand_frames` says what it may be.

    >>> import numpy as np
    >>> from itmo_video import expand, make_settings
    >>> lamp = np.full((64, 96, 3), 40, np.uint8)
    >>> lamp[24:40, 40:56] = 255
    >>> hdr = expand(lamp, make_settings("paper", layers=["expand_map"]))
    >>> hdr.rgb.dtype, hdr.rgb.shape, float(hdr.rgb.max()) > 1
    (dtype('float16'), (64, 96, 3), True)
    >>> hdr.layers["expand_map"].shape
    (64, 96)
    """
    made = expand_frames([rgb], settings, primaries=primaries, bit_depth=bit_depth, jobs=1)
    with closing(made):
        return next(made)


def expand_frames(
    pictures: Iterable[npt.NDArray[Any]],
    settings: Settings | str | None = None,
    *,
    primaries: Primaries = "rec709",
    bit_depth: int | None = None,
    jobs: int | None = None,
) -> Generator[Expanded, None, None]:
    """Expand SDR pictures in order, with the map of keyframes tracked, as `convert` does.

    Pictures are RGB (H, W, 3) of one size: uint8 or uint16 codes of full range (of `bit_depth`,
    else 8 or 16), by the settings' transfer (auto: sRGB); or floats, linear light from 0 to SDR
    white at 1. `primaries` are those of the pictures. They are read ahead by a bounded window of
    some tens of frames, for any length. While the generator runs, OpenCV uses one thread.

    `settings` may be a preset's name; the default is `default`. Raises UsageError for settings or
    arrays that do not apply, AlreadyHdrError for light above white, and DamagedInputError at a
    picture of another size, after those before it.

    >>> import numpy as np
    >>> from itmo_video import expand_frames
    >>> pan = (np.roll(np.eye(64, dtype=np.uint8) * 255, n, 1)[..., None].repeat(3, 2)
    ...        for n in range(3))
    >>> [(hdr.index, hdr.rgb.shape) for hdr in expand_frames(pan)]
    [(0, (64, 64, 3)), (1, (64, 64, 3)), (2, (64, 64, 3))]
    """
    settings = as_settings(settings)
    if not isinstance(pictures, Iterable):
        raise UsageError(f"pictures must be a series of arrays, not {type(pictures).__name__}")
    frames = ArrayFrames(pictures, settings, primaries, bit_depth)
    return _expanded(
        frames, make_look(settings), RunOptions(jobs=jobs).jobs or spans.default_jobs()
    )


def _expanded(frames: ArrayFrames, look: Look, jobs: int) -> Generator[Expanded, None, None]:
    ended: list[Exception] = []
    everything = spans.Run(0, 0, range(sys.maxsize))
    with single_opencv_thread(), ThreadPoolExecutor(jobs, thread_name_prefix="array") as pool:
        try:
            waiting: deque[Future[Expanded]] = deque()
            for span in spans.spans_of(frames, everything, look, ended.append, pool):
                for analysed in span.frames:
                    waiting.append(pool.submit(_rendered, span, analysed, look))
                    if len(waiting) > jobs:
                        yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:
            pool.shutdown(wait=True, cancel_futures=True)
    if ended:
        raise ended[0]


def _rendered(span: Span, analysed: Analysed, look: Look) -> Expanded:
    done = spans.render_from(span, analysed, look)
    layers = {name.removesuffix(".Y"): plane for name, plane in done.layers.items()}
    return Expanded(analysed.index, np.dstack(done.rgb), layers, look.settings)
