"""The filter: renders any frame by its number, from a bounded window of the clip's frames."""

from __future__ import annotations

import sys
from collections import deque
from collections.abc import Generator
from concurrent.futures import ThreadPoolExecutor
from threading import Lock
from typing import Any, NoReturn, cast

import numpy as np
import vapoursynth as vs

from itmo_video.conversion.run_options import RunOptions
from itmo_video.errors import DamagedInputError
from itmo_video.look import Look, make_look
from itmo_video.motion.keyframes import Span
from itmo_video.presets import make_settings
from itmo_video.rendering import spans
from itmo_video.rendering.opencv_threads import single_opencv_thread
from itmo_video.vapoursynth.node_frames import NodeFrames

_HELD = 3  # spans; VapourSynth requests frames nearly in order
_PRIMARIES = {"rec709": 1, "rec2020": 9}  # H.273; AP0 and AP1 have no number
_STALE = ("_Matrix", "_ChromaLocation", "_FieldBased", "_Range", "_Alpha")


def expand(clip: Any, preset: str = "default", *, jobs: int | None = None, **settings: Any) -> Any:
    """Convert an SDR clip to linear HDR: frame n has the same values as `convert`'s frame n.

    `clip` is a VideoNode of integers (YUV, RGB or GRAY, 8 to 16 bits, progressive) of one format.
    `preset` and `settings` are those of `itmo_video.make_settings`; frame properties say how codes
    are read. Returns a VideoNode in RGBS, linear, 1.0 = SDR white, in the
    primaries that `primaries` names. `jobs` threads compute maps; frames may be requested
    in any order.

    Raises UsageError for unsupported clips and settings, AlreadyHdrError for HDR.
    """
    look = make_look(make_settings(preset, **settings))
    frames = NodeFrames(clip, look.settings)
    for notice in (*frames.notices, *look.notices):
        vs.core.log_message(vs.MESSAGE_TYPE_INFORMATION, f"itmo_video: {notice}")
    expander = _Expander(frames, look, RunOptions(jobs=jobs).jobs or spans.default_jobs())
    blank = vs.core.std.BlankClip(clip, format=vs.RGBS, keep=True)

    def shown(n: int, f: list[Any]) -> Any:
        target, source = f[0].copy(), f[1]
        for name, value in source.props.items():
            if name not in _STALE:
                target.props[name] = value
        target.props["_Matrix"], target.props["_Transfer"] = 0, 8
        target.props["_Primaries"] = _PRIMARIES.get(look.settings.primaries, 2)
        for plane, values in enumerate(expander.frame(n)):
            np.asarray(target[plane])[...] = values
        return target

    return vs.core.std.ModifyFrame(blank, [blank, clip], shown)


class _Expander:
    """Renders frames by number; frames read for one serve those after it."""

    def __init__(self, frames: NodeFrames, look: Look, jobs: int) -> None:
        self._frames, self._look = frames, look
        self._pool = ThreadPoolExecutor(jobs, thread_name_prefix="vapoursynth")
        self._held: deque[Span] = deque(maxlen=_HELD)
        self._coming: Generator[Span, None, None] | None = None
        self._next = 0  # the first index of the span that comes next
        self._lock = Lock()

    def frame(self, index: int) -> tuple[Any, Any, Any]:
        """R, G and B (H, W), float16."""
        with single_opencv_thread():
            with self._lock:
                span = self._span_of(index)
            (analysed,) = (a for a in span.frames if a.index == index)
            return spans.render_from(span, analysed, self._look).rgb

    def _span_of(self, index: int) -> Span:
        for span in self._held:
            if span.frames[0].index <= index <= span.frames[-1].index:
                return span
        reach = 2 * self._look.settings.key_reach
        if self._coming is None or not self._next <= index < self._next + reach:
            self._begin(index)
        assert self._coming is not None
        try:
            for span in self._coming:
                self._held.append(span)
                self._next = span.frames[-1].index + 1
                if index < self._next:
                    return span
        except BaseException:
            self._coming = None
            raise
        raise IndexError(index)  # the clip has no such frame

    def _begin(self, index: int) -> None:
        """Start reading again, where the window of this frame begins."""
        if self._coming is not None:
            self._coming.close()
        self._held.clear()
        (run,) = spans.plan_runs([index], self._look)
        onwards = spans.Run(run.start, run.keys, range(index, sys.maxsize))
        coming = spans.spans_of(self._frames, onwards, self._look, _refuse, self._pool)
        self._coming, self._next = cast(Generator[Span, None, None], coming), index


def _refuse(error: DamagedInputError) -> NoReturn:
    raise error  # otherwise frames before the end would be rendered as if the clip ended there
