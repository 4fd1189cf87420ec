"""Converting a stream that can be read only once, frame by frame as it arrives."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from itmo_video.conversion.file_size import check_file_size
from itmo_video.conversion.frame_ranges import damage_in_words, format_ranges, parse_ranges
from itmo_video.conversion.left_frames import left_frames
from itmo_video.conversion.plan import Plan
from itmo_video.conversion.run_options import RunOptions
from itmo_video.conversion.summary import Summary, count_frame, nothing_expanded
from itmo_video.conversion.written_frames import peak_of, write_frame
from itmo_video.errors import DamagedInputError, OutputError, UsageError
from itmo_video.events import Finished, FrameDone, OnEvent, Started, Warned
from itmo_video.look import Look, make_look
from itmo_video.model import Frame
from itmo_video.output.folder import OutputFolder
from itmo_video.rendering import spans
from itmo_video.rendering.frame import Rendered
from itmo_video.settings import Settings
from itmo_video.source.opening import input_options
from itmo_video.source.pipe import PipeClip
from itmo_video.words import counted, frames_are, frames_named

ENDLESS = range(2**40)  # indices of a stream, more than any has


@dataclass(frozen=True)
class NumbersFrom(Mapping[int, int]):
    """File numbers to indices, for any number of frames."""

    first: int

    def __getitem__(self, number: int) -> int:
        index = number - self.first
        if index < 0:
            raise KeyError(number)
        return index

    def __iter__(self) -> Iterator[int]:
        raise TypeError("the number of frames of a pipe is unknown")

    def __len__(self) -> int:
        raise TypeError("the number of frames of a pipe is unknown")


def first_number(run: RunOptions) -> int:
    """The number of a stream's first frame."""
    return 1 if run.start_number is None else run.start_number


def pipe_plan(clip: PipeClip, look: Look, run: RunOptions) -> Plan:
    """The plan for a stream of unknown length; raises UsageError for unsupported options."""
    if run.analysis is not None:
        raise UsageError("--analysis cannot be used with a pipe", remedy="Convert the file itself.")
    info = clip.info
    if not run.null:
        check_file_size(info, look.settings)
    jobs = run.jobs or spans.default_jobs()
    wide = 1 if info.encoding.bit_depth == 8 else 2
    memory = spans.memory_bound_bytes(*info.display_size, wide, look, jobs)
    numbers = NumbersFrom(first_number(run))
    return Plan(
        info, look, numbers, first_number(run), memory, jobs, notices=(*info.notices, *look.notices)
    )


def wanted_indices(run: RunOptions) -> range | list[int]:
    """The indices that a run selects, sorted; all if it names none."""
    if run.frames is None:
        return ENDLESS
    numbers = parse_ranges(run.frames)
    if before := [n for n in numbers if n < first_number(run)]:
        raise UsageError(
            f"{frames_are(format_ranges(before))} not in the stream",
            remedy=f"The first frame is number {first_number(run)}.",
        )
    return sorted(n - first_number(run) for n in numbers)


def convert_pipe(
    source: str | Path, output: str | Path, settings: Settings, run: RunOptions, on_event: OnEvent
) -> Summary:
    """Convert a piped stream; see `convert`.

    All frames are rendered, as it is not known beforehand whether existing frames came from the
    same stream: raises OutputError if there are any, unless the run overwrites.
    """
    began = time.monotonic()
    _check_run(run)
    clip = PipeClip(source, input_options(settings, run.max_pixels))
    try:
        plan = pipe_plan(clip, make_look(settings), run)
        wanted = wanted_indices(run)
        folder = OutputFolder(output, plan.clip.stem)
        for notice in plan.notices:
            on_event(Warned(notice))
        if not run.null:
            if not run.overwrite and folder.path.is_dir() and folder.frame_numbers():
                raise OutputError(
                    "the folder already has frames, and a pipe cannot be resumed",
                    where=str(output),
                    remedy="Use --overwrite to re-render all of them, or choose another folder.",
                )
            folder.claim(plan.manifest, overwrite=run.overwrite, update=False)
            folder.sweep_temp_files()
        summary = Summary(0 if run.frames is None else len(wanted), 0)
        on_event(Started(plan.clip.path, str(output), summary.wanted, 0))
        made = _render(clip, plan, folder, run, wanted, summary, on_event)
    finally:
        clip.close()
    if run.frames is not None:
        summary.missing = [n for n in parse_ranges(run.frames) if n not in made]
    summary.wanted = summary.wanted or summary.written + len(clip.lost)
    summary.damaged.sort()
    summary.seconds = time.monotonic() - began
    if unexpanded := nothing_expanded(plan, summary):
        on_event(Warned(unexpanded))
    frames_read = summary.written + len(clip.lost) if run.frames is None else None
    for left in left_frames(plan, folder, run, made, frames_read):
        on_event(Warned(left))
    on_event(Finished(**asdict(summary)))
    told = pipe_damage(clip, run, summary.missing)
    told += damage_in_words(summary.damaged)
    if told:
        raise DamagedInputError(
            "; ".join(told),
            where=plan.clip.path,
            remedy=f"{'What came before' if clip.broken else 'Everything else'} was converted: "
            f"{counted(summary.written, 'frame')}.",
        )
    return summary


def pipe_damage(clip: PipeClip, run: RunOptions, missing: Sequence[int] = ()) -> list[str]:
    """Damage of a stream that has been read; `missing` are numbers that never arrived."""
    lost = [index + first_number(run) for index in clip.lost]
    told = [clip.broken] if clip.broken else []
    if run.frames is None and lost:
        told.append(f"{frames_named(format_ranges(lost))} could not be decoded")
    if missing:
        told.append(f"{frames_named(format_ranges(missing))} did not arrive")
    return told


def _check_run(run: RunOptions) -> None:
    if run.update:
        raise UsageError(
            "a pipe cannot be resumed: all frames are rendered", remedy="Omit --update."
        )


def _render(
    clip: PipeClip,
    plan: Plan,
    folder: OutputFolder,
    run: RunOptions,
    wanted: Sequence[int],
    summary: Summary,
    on_event: OnEvent,
) -> set[int]:
    """Render and write the frames; returns the numbers rendered, if only some were selected."""
    lock, made = threading.Lock(), set[int]()

    def sink(frame: Frame, rendered: Rendered) -> None:
        number = frame.index + plan.first_number
        size = write_frame(plan, folder, run, number, frame, rendered)
        peak = peak_of(rendered.rgb) * plan.settings.white_nits
        with lock:
            if run.frames is not None:
                made.add(number)
            count_frame(summary, number, size, peak, is_damaged=frame.is_damaged)
            on_event(FrameDone(number, summary.written, summary.wanted))

    ended = spans.render_frames(clip, wanted, plan.look, plan.jobs, sink)
    clip.broken = clip.broken or next((error.what for error in ended), None)
    return made
