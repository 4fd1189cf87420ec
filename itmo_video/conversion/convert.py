"""Converting a clip: claim the folder, render missing frames, report."""

from __future__ import annotations

import dataclasses
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from itmo_video.conversion.frame_ranges import damage_in_words, format_ranges
from itmo_video.conversion.from_pipe import convert_pipe
from itmo_video.conversion.left_frames import left_frames
from itmo_video.conversion.plan import Plan, make_plan
from itmo_video.conversion.run_options import RunOptions
from itmo_video.conversion.summary import Summary, count_frame, nothing_expanded
from itmo_video.conversion.written_frames import peak_of, write_frame
from itmo_video.errors import DamagedInputError, OutputError, UsageError
from itmo_video.events import Finished, FrameDone, OnEvent, Started, Warned, ignore
from itmo_video.look import make_look
from itmo_video.model import Frame
from itmo_video.options import checked, checked_path
from itmo_video.output import disk_space
from itmo_video.output.folder import OutputFolder
from itmo_video.output.folder_names import check_folder_name
from itmo_video.presets import as_settings
from itmo_video.rendering import spans
from itmo_video.rendering.frame import Rendered
from itmo_video.settings import Settings
from itmo_video.source.opening import Clip, input_options, open_clip
from itmo_video.source.pipe import is_pipe
from itmo_video.words import counted, frames_are, frames_named, missing


class ToMake(NamedTuple):
    """The frames still to be rendered, index by number, and the numbers of frames to be kept.

    `others` were made with other settings, `concealed` from damaged frames of the source.
    """

    todo: dict[int, int]
    others: Sequence[int] = ()
    concealed: Sequence[int] = ()


@dataclass(frozen=True)
class Job:
    """An open clip, its plan, and the frames still to be rendered, index by number."""

    clip: Clip
    plan: Plan
    folder: OutputFolder
    run: RunOptions
    todo: Mapping[int, int]


# A function that renders a job's frames, fills in the summary and returns any early end.
Executor = Callable[[Job, Summary, OnEvent], list[DamagedInputError]]


def convert(
    source: str | Path,
    output: str | Path,
    settings: Settings | str | None = None,
    run: RunOptions | None = None,
    on_event: OnEvent = ignore,
    executor: Executor | None = None,
) -> Summary:
    """Convert a clip to an EXR sequence OUTPUT/<stem>.%04d.exr; intact frames are kept.

    `settings` may be a preset's name, by default `default`. `on_event` is called with Started,
    FrameDone, Warned and Finished (itmo_video.events), from worker threads, one at a time.
    `executor` renders elsewhere. Raises the errors of itmo_video.errors; DamagedInputError only
    after all decodable frames were written, OutputError for single frames with other settings only
    after all others were.

    >>> from itmo_video import RunOptions, convert, make_settings
    >>> settings = make_settings("default", peak_nits=600, layers=["expand_map"])
    >>> summary = convert("clip.mkv", "out", settings, RunOptions(frames="2-3"))
    >>> summary.written, summary.missing
    (2, [])
    """
    settings, run = as_settings(settings), checked(run, RunOptions, "run")
    source, output = checked_path(source, "source"), checked_path(output, "output")
    check_folder_name(output, source)
    if is_pipe(source):
        if executor is not None:
            raise UsageError("a pipe cannot be distributed", remedy="Convert the file itself.")
        return convert_pipe(source, output, settings, run, on_event)
    began = time.monotonic()
    with open_clip(source, input_options(settings, run.max_pixels)) as clip:
        plan = make_plan(clip, make_look(settings), run)
        folder = OutputFolder(output, plan.clip.stem)
        for notice in plan.notices:
            on_event(Warned(notice))
        todo, others, concealed = ToMake(dict(plan.numbers))
        if not run.null:
            folder.claim(plan.manifest, overwrite=run.overwrite, update=run.update)
            folder.sweep_temp_files()
            todo, others, concealed = frames_to_make(plan, folder, run)
            if short := folder_shortage(plan, folder, len(todo)):
                on_event(Warned(short))
        summary = Summary(len(plan.numbers), len(plan.numbers) - len(todo) - len(others))
        summary.damaged.extend(concealed)
        on_event(Started(plan.clip.path, str(output), summary.wanted, summary.present))
        ended = (executor or render_job)(Job(clip, plan, folder, run, todo), summary, on_event)
    summary.missing.sort()
    summary.damaged.sort()
    summary.seconds = time.monotonic() - began
    if unexpanded := nothing_expanded(plan, summary):
        on_event(Warned(unexpanded))
    for left in left_frames(plan, folder, run, {*plan.numbers} - {*summary.missing}):
        on_event(Warned(left))
    on_event(Finished(**dataclasses.asdict(summary)))
    cut_short = plan.clip.frames_cut_off if run.frames is None else 0
    if ended or summary.missing or summary.damaged or cut_short:
        raise _damage(plan, summary, ended, cut_short, clip.faults)
    if others:
        raise rendered_otherwise(others, folder)
    return summary


def frames_to_make(plan: Plan, folder: OutputFolder, run: RunOptions) -> ToMake:
    """What is still to be made of a plan.

    A frame is there if it opens whole with its fingerprint. Those that open whole with another one
    are left alone unless the run says to update or overwrite.
    """
    if run.overwrite:
        return ToMake(dict(plan.numbers))
    states = folder.states({n: plan.fingerprint(n) for n in plan.numbers}, plan.jobs, plan.form)
    others = [] if run.update else [n for n, state in states.items() if state == "other"]
    concealed = [n for n, state in states.items() if state == "concealed"]
    done = {n for n, state in states.items() if state == "whole"} | {*others, *concealed}
    return ToMake({n: i for n, i in plan.numbers.items() if n not in done}, others, concealed)


def render_job(job: Job, summary: Summary, on_event: OnEvent) -> list[DamagedInputError]:
    """Render a job's frames in threads of this process and write each atomically."""
    plan, run = job.plan, job.run
    by_index = {index: number for number, index in job.todo.items()}
    lock = threading.Lock()

    def sink(frame: Frame, rendered: Rendered) -> None:
        number = by_index[frame.index]
        size = write_frame(plan, job.folder, run, number, frame, rendered)
        peak = peak_of(rendered.rgb) * plan.settings.white_nits
        with lock:
            by_index.pop(frame.index)
            count_frame(summary, number, size, peak, is_damaged=frame.is_damaged)
            on_event(FrameDone(number, summary.written, len(job.todo)))

    ended = spans.render_frames(
        job.clip, sorted(by_index), plan.look, plan.jobs, sink, plan.look_at
    )
    summary.missing.extend(by_index.values())
    return ended


def rendered_otherwise(numbers: Sequence[int], folder: OutputFolder) -> OutputError:
    """What is raised for frames that are kept though they were made with other settings."""
    return OutputError(
        f"{frames_named(format_ranges(numbers))} rendered with other settings",
        where=str(folder.path),
        remedy="Use --update to re-render them, or choose another folder.",
    )


def _damage(
    plan: Plan,
    summary: Summary,
    ended: list[DamagedInputError],
    cut_short: int,
    faults: Mapping[int, str],
) -> DamagedInputError:
    told = [error.what for error in ended]
    if summary.missing:
        missing_at = [plan.numbers[number] for number in summary.missing]
        reasons = [faults[index] for index in missing_at if index in faults]
        why = f" ({'; '.join(reasons[:3])}{', ...' * (len(reasons) > 3)})" if reasons else ""
        told.append(
            f"{frames_are(format_ranges(summary.missing))} missing or cannot be decoded{why}"
        )
    told += damage_in_words(summary.damaged)
    if cut_short:
        told.append(f"the file is truncated or damaged: {missing(cut_short, 'frame')}")
    made = counted(summary.written + summary.present, "frame")
    return DamagedInputError(
        "; ".join(told),
        where=plan.clip.path,
        remedy=f"Everything else was converted: {made}.",
    )


def folder_shortage(plan: Plan, folder: OutputFolder, frames: int) -> str | None:
    """A notice if so many frames hardly fit on the folder's disk, otherwise None."""
    needed = frames * plan.estimated_frame_bytes
    return disk_space.shortage(needed, disk_space.free_bytes(folder.path), str(folder.path))
