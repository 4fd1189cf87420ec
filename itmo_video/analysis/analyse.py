"""One pass over a clip: its shots, keyframes, times and statistics, for `analyse`."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Collection, Iterator
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import numpy.typing as npt

from itmo_video.analysis.edit_lists import read_edit
from itmo_video.analysis.lamps import lamps_count
from itmo_video.analysis.model import Analysis, Bars, Shot, Statistics
from itmo_video.analysis.suggestions import suggestions
from itmo_video.colour.luminance import limited_luminance
from itmo_video.colour.transfer import BT1886_GAMMA
from itmo_video.errors import DamagedInputError, InputError, ReplacedInputError, UsageError
from itmo_video.events import FrameDone, OnEvent, Warned, ignore
from itmo_video.model import ClipInfo, Frame
from itmo_video.motion.cut_detection import CUT_REACH, Analysed, analyse_frame, difference, place
from itmo_video.operators.auto_rendering import (
    Rendering,
    averaged_codes_linear,
    rendering_of,
)
from itmo_video.options import checked_path
from itmo_video.presets import as_settings
from itmo_video.settings import Settings
from itmo_video.source.clip import first_number
from itmo_video.source.files import MAX_PIXELS
from itmo_video.source.opening import Clip, input_options, open_clip
from itmo_video.source.read_faults import FailingDiskError
from itmo_video.words import counted

_BINS = 1024  # of luminance coded by BT.1886, for roughly uniform perception
_CLIPPED = 0.99  # of white, as compression makes clipped areas vary
_BAR = 0.06  # of white, as bars vary, too


class _Tally:
    """Running sums over frames, of bounded size."""

    def __init__(self) -> None:
        self.histogram = np.zeros(_BINS, np.int64)
        self.total = self.maximum = self.clipped = self.change = 0.0
        self.frames = self.changes = 0
        self.rendering = np.zeros(6)  # measures of rendering_of

    def add(self, other: _Tally) -> None:
        self.histogram += other.histogram
        self.total += other.total
        self.maximum = max(self.maximum, other.maximum)
        self.clipped += other.clipped
        self.change += other.change
        self.frames += other.frames
        self.changes += other.changes
        self.rendering += other.rendering

    def in_words(self, settings: Settings) -> str | None:
        """How the frames were rendered to SDR, and what is done; None if not needed."""
        if settings.operator != "auto":
            return None
        measures = (self.rendering / max(1, self.frames)).tolist()
        found = replace(Rendering(*measures), footage=settings.footage)
        told = found.in_words(settings.l_max_effective)
        return told if lamps_count(found, settings) else f"{told}; lamps has no effect"

    def statistics(self) -> Statistics:
        levels = ((np.arange(_BINS) + 0.5) / _BINS) ** BT1886_GAMMA
        so_far = np.cumsum(self.histogram) / max(1, self.histogram.sum())
        shares = [levels[np.searchsorted(so_far, p)] for p in (0.01, 0.5, 0.95, 0.99)]
        p1, p50, p95, p99 = (round(min(float(level), self.maximum), 6) for level in shares)
        frames = max(1, self.frames)
        return Statistics(
            mean=round(self.total / frames, 6),
            p1=p1, p50=p50, p95=p95, p99=p99,
            maximum=round(self.maximum, 6),
            clipped=round(self.clipped / frames, 6),
            change=round(self.change / max(1, self.changes), 6),
        )  # fmt: skip


class _Edges:
    """The brightest code of each row and column over all frames, 0 black to 1 white."""

    def __init__(self) -> None:
        self.rows: npt.NDArray[np.float64] | None = None
        self.columns: npt.NDArray[np.float64] | None = None

    def add(self, frame: Frame) -> None:
        black, span = frame.encoding.black_and_span
        planes = _luma_planes(frame)
        rows = (np.max([p.max(axis=1) for p in planes], axis=0) - black) / span
        columns = (np.max([p.max(axis=0) for p in planes], axis=0) - black) / span
        self.rows = rows if self.rows is None else np.maximum(self.rows, rows)
        self.columns = columns if self.columns is None else np.maximum(self.columns, columns)

    def bars(self) -> Bars:
        if self.rows is None or self.columns is None or self.rows.max() <= _BAR:
            return Bars()  # all black: there is no picture for bars to surround
        y, x = np.flatnonzero(self.rows > _BAR), np.flatnonzero(self.columns > _BAR)
        return Bars(
            int(x[0]), int(self.columns.size - 1 - x[-1]),
            int(y[0]), int(self.rows.size - 1 - y[-1]),
        )  # fmt: skip


def analyse(
    source: str | Path,
    settings: Settings | str | None = None,
    *,
    frames: Collection[int] | None = None,
    start_number: int | None = None,
    max_pixels: int = MAX_PIXELS,
    edit: str | Path | None = None,
    on_event: OnEvent = ignore,
) -> Analysis:
    """Decode a clip once and analyse it; raises InputError and AlreadyHdrError like `convert`.

    Raises DamagedInputError if it changes meanwhile.

    The shots are those between cuts, or those of an edit list `edit` (.otio, .edl; extra `otio`).
    Cuts and keyframes are those that a conversion with `settings` would find. With `frames`
    (numbers as in file names) only these are analysed and listed as shots. A truncated source is
    analysed up to its end; `on_event` is called with Warned for this, for damaged frames and for
    assumptions, and with FrameDone for each frame; an exception from it stops the pass.

    >>> from itmo_video import analyse
    >>> found = analyse("clip.mkv")
    >>> [(shot.first, shot.last) for shot in found.shots]
    [(1, 3)]
    """
    settings, source = as_settings(settings), checked_path(source, "source")
    with open_clip(source, input_options(settings, max_pixels)) as clip:
        info = clip.info
        for notice in info.notices:
            on_event(Warned(notice))
        first = first_number(info, start_number)
        wanted = _indices(info, first, frames)
        cuts: list[int] = []
        begun: int | None = None
        tallies: dict[int, _Tally] = {}
        times: list[Fraction] = []
        edges = _Edges()
        edited = None if edit is None else read_edit(edit, info)
        whole = _Tally()
        shots: list[tuple[int, int, _Tally]] = []
        own = [(begin, end, _Tally()) for begin, end in edited or ()]
        begins = [begin for begin, _, _ in own]
        keys: list[int] = []
        start = max(0, min(wanted) - 2 * CUT_REACH)  # a cut is detected from the frames around it
        looked_at = _looked_at(clip, start, wanted, settings, tallies, times, edges, on_event)
        done = 0
        damaged: list[int] = []
        for placed in place(looked_at, settings.key_reach, start):
            index = placed.analysed.index
            begun = index if begun is None else begun
            if index not in wanted:
                continue
            done += 1
            if placed.analysed.frame.is_damaged:
                damaged.append(first + index)
            on_event(FrameDone(first + index, done, len(wanted)))
            tally = tallies.pop(index)
            if placed.starts_shot and index != begun:
                cuts.append(first + index)
            if placed.starts_shot or index - 1 not in wanted or not shots:
                tally.change, tally.changes = 0.0, 0  # a cut is not motion
                shots.append((index, index, _Tally()))
            shots[-1] = (shots[-1][0], index, shots[-1][2])
            shots[-1][2].add(tally)
            whole.add(tally)
            at = bisect_right(begins, index) - 1
            if at >= 0 and index <= own[at][1]:
                own[at][2].add(tally)
            if placed.is_key:
                keys.append(first + index)
        if not shots:
            raise InputError("no frame can be decoded", where=str(source))
    seen = {index for begin, end, _ in shots for index in range(begin, end + 1)}
    lost = [first + index for index in sorted(wanted) if index not in seen]
    for numbers, what in (
        (damaged, "damaged in the source"),
        (lost, "missing or cannot be decoded"),
    ):
        if numbers:
            on_event(Warned(f"{counted(len(numbers), 'frame')} from frame {numbers[0]} on: {what}"))
    statistics = whole.statistics()
    return Analysis(
        source_name=Path(info.path).name,
        digest=info.digest,
        frames=info.frames,
        first_number=first,
        cuts=tuple(cuts),
        keyframes=tuple(keys),
        times_s=tuple(times),
        statistics=statistics,
        bars=edges.bars(),
        suggestions=suggestions(info, statistics, settings),
        shots=tuple(
            Shot(
                first + begin,
                first + end,
                statistics=tally.statistics(),
                rendering=tally.in_words(settings),
            )
            for begin, end, tally in (shots if edited is None else own)
            if tally.frames or frames is None
        ),
    )


def _indices(info: ClipInfo, first: int, frames: Collection[int] | None) -> Collection[int]:
    """The indices to analyse; raises UsageError for numbers that the clip does not have."""
    if frames is None:
        return range(info.frames)
    outside = [n for n in frames if not first <= n < first + info.frames]
    if outside or not frames:
        raise UsageError(
            f"frame {outside[0]} is not in the clip" if outside else "no frames are selected",
            where=info.path,
            remedy=f"It has {first}-{first + info.frames - 1}.",
        )
    return {n - first for n in frames}


def _looked_at(
    clip: Clip,
    start: int,
    wanted: Collection[int],
    settings: Settings,
    tallies: dict[int, _Tally],
    times: list[Fraction],
    edges: _Edges,
    on_event: OnEvent,
) -> Iterator[Analysed]:
    before: Analysed | None = None
    try:
        last = max(wanted) + 2 * CUT_REACH
        for frame in clip.frames(start):
            if frame.index > last:
                return
            analysed = analyse_frame(frame, settings.map_width)
            if frame.index not in wanted:
                before = None
                yield analysed
                continue
            tally = _tally(frame, settings.map_width)
            if before is not None and before.index + 1 == frame.index:
                tally.change, tally.changes = difference(before, analysed), 1
            tallies[frame.index] = tally
            times.append(frame.time_s)
            edges.add(frame)
            before = analysed
            yield analysed
    except (ReplacedInputError, FailingDiskError):
        raise  # the results would not apply to the changed file
    except DamagedInputError as error:
        on_event(Warned(str(error)))


def _tally(frame: Frame, map_width: int) -> _Tally:
    tally = _Tally()
    tally.frames = 1
    rgb_linear = averaged_codes_linear(frame, map_width)
    luminance = limited_luminance(rgb_linear)
    tally.rendering[:] = rendering_of(np.clip(np.dstack(rgb_linear), 0, 1)).measures
    bins = np.minimum(luminance ** (1 / BT1886_GAMMA) * _BINS, _BINS - 1).astype(np.int64)
    tally.histogram = np.bincount(bins.ravel(), minlength=_BINS)
    tally.total, tally.maximum = float(luminance.mean(dtype=np.float64)), float(luminance.max())
    black, span = frame.encoding.black_and_span
    masks = [p >= black + _CLIPPED * span for p in _luma_planes(frame)]
    tally.clipped = float(np.count_nonzero(np.logical_or.reduce(masks)) / masks[0].size)
    return tally


def _luma_planes(frame: Frame) -> list[npt.NDArray[np.integer]]:
    return list(frame.planes[: 3 if frame.encoding.family == "rgb" else 1])
