"""Renders the frames of spans in a bounded pool: decoded in order, rendered in parallel."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    FIRST_EXCEPTION,
    Executor,
    Future,
    ThreadPoolExecutor,
    wait,
)
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Protocol

from itmo_video import reused_memory
from itmo_video.colour.analysis_picture import analysis_size
from itmo_video.errors import DamagedInputError, ReplacedInputError
from itmo_video.expand_map.key_map import make_key_map
from itmo_video.look import Look
from itmo_video.model import Float32, Frame
from itmo_video.motion import flow, keyframes
from itmo_video.motion.cut_detection import CUT_REACH, Analysed, analyse_frame, place
from itmo_video.motion.flow import FindFlow, flow_px
from itmo_video.motion.keyframes import Span
from itmo_video.rendering.frame import Rendered, render
from itmo_video.rendering.map_settings import shares_maps
from itmo_video.rendering.opencv_threads import single_opencv_thread
from itmo_video.source.opening import Clip

Sink = Callable[[Frame, Rendered], None]
LookAt = Callable[[int], Look]
Analyse = Callable[[Frame, int], Analysed]
MakeMap = Callable[[Frame, Look], Float32]


@dataclass(frozen=True)
class Run:
    """Frames rendered in one pass: decode from `start`, compute keyframes from `keys`."""

    start: int
    keys: int
    wanted: frozenset[int] | range

    @property
    def last(self) -> int:
        """The last index wanted."""
        return self.wanted[-1] if isinstance(self.wanted, range) else max(self.wanted)


class Frames(Protocol):
    """A source of frames: a clip, or anything else that yields them in order."""

    def frames(self, start: int = 0) -> Iterator[Frame]:
        """Yield the frames from index `start` on; the same frames for any `start`."""


def default_jobs() -> int:
    """The default number of worker threads: the cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def plan_runs(wanted: Sequence[int], look: Look) -> list[Run]:
    """Group sorted indices into runs, each with the lead-in that the window needs."""
    interval, smooth = look.settings.key_reach, look.settings.smooth_reach
    lead_keys, lead = keyframes.lead_in(interval, smooth)
    groups: list[list[int]] = []
    for index in wanted:
        # Decoding through a gap shorter than the lead-in is cheaper than starting again after it.
        if groups and index - groups[-1][-1] <= lead + interval:
            groups[-1].append(index)
        else:
            groups.append([index])
    runs = []
    for group in groups:
        grid = group[0] - group[0] % interval
        keys = max(0, grid - lead_keys)
        runs.append(Run(max(0, grid - lead), keys, frozenset(group)))
    return runs


def whole_run(wanted: Sequence[int]) -> Run:
    """One run from the first frame on, for sources that cannot be read from a later one."""
    return Run(0, 0, wanted if isinstance(wanted, range) else frozenset(wanted))


def planned_runs(
    wanted: Sequence[int], look: Look, look_at: LookAt | None
) -> Iterator[tuple[Run, Look]]:
    """The runs of sorted indices, each with a look whose maps its frames share."""
    if look_at is None:
        yield from ((run, look) for run in plan_runs(wanted, look))
        return
    stretch: list[int] = []
    for index in wanted:
        own = look_at(index)
        if stretch and not (own is look or shares_maps(own, look)):
            yield from ((run, look) for run in plan_runs(stretch, look))
            stretch = []
        if not stretch:
            look = own
        stretch.append(index)
    yield from ((run, look) for run in plan_runs(stretch, look))


def frames_in_flight(look: Look, jobs: int) -> int:
    """Upper bound of the decoded frames held at a time, for any clip.

    Some wait for a worker (`_most_pending`); behind them wait the next span and those whose
    keyframes its smoothing looks ahead to, then a last keyframe and the window for detecting cuts
    and flashes. A flash makes one span longer and the next one as much shorter.
    """
    spans = 1 + look.settings.smooth_reach
    waiting = spans * look.settings.key_reach + CUT_REACH + 1
    return _most_pending(look, jobs) + waiting + CUT_REACH + 3


def _most_pending(look: Look, jobs: int) -> int:
    """The frames that are rendered or wait for a worker: enough while a span is decoded."""
    return jobs + look.settings.key_reach


def memory_bound_bytes(width: int, height: int, bytes_per_code: int, look: Look, jobs: int) -> int:
    """Upper bound of the memory of frames in flight: waiting codes, and workers' float planes.

    A worker holds about 14 float planes and its half-float result and file. Decoders keep a border
    around pictures. At analysis size a keyframe has a guide, a grey picture, a map and two flows.
    """
    small_width, small_height = analysis_size(width, height, look.settings.map_width)
    codes = (width + 128) * (height + 64) * 3 * bytes_per_code
    analysed = small_width * small_height * (4 + 1 + 4 + 2 * 8)
    waiting = frames_in_flight(look, jobs) * (codes + analysed)
    return waiting + jobs * width * height * (14 * 4 + 2 * 3 * 2) + (160 << 20)


def spans_of(
    clip: Frames,
    run: Run,
    look: Look,
    on_end: Callable[[DamagedInputError], None],
    pool: Executor,
    analyse: Analyse = analyse_frame,
    make_map: MakeMap = make_key_map,
    find_flow: FindFlow = flow_px,
) -> Iterator[Span]:
    """The run's spans in order, up to its last wanted frame; a broken end ends the last shot.

    Their maps are computed in the `pool`. Callers that render frames repeatedly pass functions
    that cache.
    """

    def source() -> Iterator[Analysed]:
        try:
            for frame in clip.frames(run.start):
                yield analyse(frame, look.settings.map_width)
        except DamagedInputError as error:
            on_end(error)
            if isinstance(error, ReplacedInputError):
                raise  # spans that wait for later keyframes would lack those the file had

    def key_map(analysed: Analysed) -> Float32:
        return make_map(analysed.frame, look)

    settings = look.settings
    placed = place(source(), settings.key_reach, run.start)
    spans = keyframes.spans(
        placed,
        key_map if look.needs_map else None,
        settings.smooth_reach if look.needs_map else 0,
        run.keys,
        lambda frames: any(a.index in run.wanted for a in frames),
        pool,
        find_flow,
    )
    with suppress(ReplacedInputError):  # reported by on_end
        for span in spans:
            is_last = span.frames[-1].index >= run.last
            yield span
            del span  # its pixels are not kept while later frames are decoded
            if is_last:
                return


def render_from(
    span: Span, analysed: Analysed, look: Look, look_at: LookAt | None = None
) -> Rendered:
    """Render one frame of a span, which need not contain its `frames`; see render_frames."""
    map_small = map_between(span, analysed, look) if look.needs_map else None
    own = look_at(analysed.index) if look_at else look
    return render(analysed.frame, map_small, own, analysed.guide)


def map_between(
    span: Span,
    analysed: Analysed,
    look: Look,
    make_map: MakeMap = make_key_map,
    find_flow: FindFlow = flow_px,
) -> Float32:
    """The map of one frame of a span: a keyframe's own, or blended from those on either side."""
    index = analysed.index
    if index in span.flashes:
        return make_map(analysed.frame, look)
    if span.right is None or span.right_index is None or index == span.left_index:
        return span.left[1].result()
    t = (index - span.left_index) / (span.right_index - span.left_index)
    (left, left_map), (right, right_map) = span.left, span.right
    if look.settings.temporal == "blend":
        return flow.blend_maps(left_map.result(), right_map.result(), t, 1.0, 1.0)
    keys = (left, left_map.result()), (right, right_map.result())
    return flow.track_map(analysed.motion, *keys, t, find_flow)


@single_opencv_thread()
@reused_memory.kept()
def render_frames(
    clip: Clip,
    wanted: Sequence[int],
    look: Look,
    jobs: int,
    sink: Sink,
    look_at: LookAt | None = None,
    on_planned: Callable[[Sequence[int]], None] = lambda indices: None,
    on_stop: Callable[[], None] = lambda: None,
) -> list[DamagedInputError]:
    """Render the wanted indices (sorted) and pass each to `sink`, called from worker threads.

    A range may extend beyond the end of a clip that is read once, which has one look.

    `look_at` gives each index its look: a frame is identical to that of a clip converted with this
    look alone, so a shot's settings do not affect the frames around it. `on_planned` receives, in
    presentation order, the indices of each span before any is started, so that callers can restore
    the order. `on_stop` is called when a worker or the decoder has failed, before the workers still
    running are waited for. Memory is bounded by `frames_in_flight`, not the clip's length. Returns
    what cut the source short; raises what a worker or the decoder raised, after frames being
    rendered are finished.
    """
    ended: list[DamagedInputError] = []
    pending: set[Future[None]] = set()

    def render_one(span: Span, analysed: Analysed, look: Look) -> None:
        sink(analysed.frame, render_from(span, analysed, look, look_at))

    pool = ThreadPoolExecutor(jobs, thread_name_prefix="frame")
    try:
        runs = [(whole_run(wanted), look)] if clip.reads_once else None
        for run, own in runs or planned_runs(wanted, look, look_at):
            for span in spans_of(clip, run, own, ended.append, pool):
                selected = [a for a in span.frames if a.index in run.wanted]
                on_planned([a.index for a in selected])
                maps = replace(span, frames=())
                del span
                while selected:
                    while len(pending) >= _most_pending(own, jobs):
                        finished, pending = wait(pending, return_when=FIRST_COMPLETED)
                        for future in finished:
                            future.result()
                    pending.add(pool.submit(render_one, maps, selected.pop(0), own))
        # A sink may make others wait for a frame that will not come: the first failure counts.
        for future in wait(pending, return_when=FIRST_EXCEPTION).done:
            future.result()
    except BaseException:
        on_stop()
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
    return ended
