"""Splits a job into chunks of frames, and renders a chunk: the work of a cluster's worker."""

from __future__ import annotations

import functools
import os
import signal
import socket
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

from itmo_video.cluster.allocator import keep_freed_memory
from itmo_video.conversion.convert import Job, ToMake, frames_to_make, render_job
from itmo_video.conversion.frame_ranges import format_ranges
from itmo_video.conversion.plan import ALGORITHM, Plan, ShotLook, make_plan
from itmo_video.conversion.run_options import RunOptions
from itmo_video.conversion.summary import Summary
from itmo_video.errors import ClusterError, DamagedInputError, InputError, ItmoError, OutputError
from itmo_video.events import ignore
from itmo_video.kernels.arithmetic import arithmetic
from itmo_video.look import make_look
from itmo_video.output.atomic import sweep_temp_files
from itmo_video.output.folder import OutputFolder
from itmo_video.output.manifest import read_manifest
from itmo_video.settings import Settings
from itmo_video.source.opening import Clip, input_options, open_clip
from itmo_video.source.tags import InputOptions

# Frames. The window around a chunk costs about as much as 50 more frames.
SHORTEST, ENOUGH, LONGEST = 20, 75, 200
MOST_PER_WORKER = 4  # unless that makes chunks too long: one slow worker then delays the end less


@dataclass(frozen=True)
class Chunk:
    """Frames for one worker, with all it needs to render them; small, as it is sent.

    `shots` are the first and last index of frames with their own settings, and these.
    """

    source: str
    digest: str
    output: str
    settings: Settings
    shots: tuple[tuple[int, int, Settings], ...]
    run: RunOptions
    numbers: tuple[int, ...]
    algorithm: int = ALGORITHM
    arithmetic: str = field(default_factory=arithmetic)


@dataclass(frozen=True)
class Outcome:
    """A chunk's result: numbers rendered (or present), damaged, not decodable; bytes."""

    made: tuple[int, ...]
    damaged: tuple[int, ...]
    missing: tuple[int, ...]
    bytes_written: int
    peak_nits: float
    ended: tuple[DamagedInputError, ...]


def chunk_length(frames: int, workers: int, key_interval: int) -> int:
    """Frames per chunk, whole keyframe intervals: up to four chunks per worker, within bounds.

    A worker gets several only if each has ENOUGH frames.
    """
    share = -(-frames // max(1, workers))
    length = -(-share // max(1, min(MOST_PER_WORKER, share // ENOUGH)))
    return -(-max(SHORTEST, min(LONGEST, length)) // key_interval) * key_interval


def cut_into_chunks(job: Job, workers: int) -> Iterator[Chunk]:
    """The job's frames in order, split on the absolute grid of keyframes."""
    plan = job.plan
    reach = plan.settings.key_reach
    length = chunk_length(len(job.todo), workers, reach)
    by_index = sorted((index, number) for number, index in job.todo.items())
    begin = by_index[0][0] // reach * reach if by_index else 0
    groups: dict[int, list[int]] = {}
    for index, number in by_index:
        groups.setdefault((index - begin) // length, []).append(number)
    for numbers in groups.values():
        yield Chunk(
            source=plan.clip.path,
            digest=plan.clip.digest,
            output=os.path.abspath(job.folder.path),
            settings=plan.settings,
            shots=_own(plan, numbers),
            run=replace(job.run, frames=format_ranges(numbers), jobs=1, analysis=None),
            numbers=tuple(numbers),
        )


def make_chunk(chunk: Chunk) -> Outcome:
    """Render a chunk's frames here and write them; frames already present stay.

    Raises ClusterError if this worker's version gives other pixels, InputError or OutputError if it
    does not see the same source and folder as the sender of the chunk.
    """
    keep_freed_memory()
    if chunk.algorithm != ALGORITHM:
        raise ClusterError(
            f"the worker on {socket.gethostname()} has another version of itmo_video",
            remedy="Install the same version everywhere, then run the same command again.",
        )
    if chunk.arithmetic != arithmetic():
        raise ClusterError(
            f"the worker on {socket.gethostname()} computes differently ({arithmetic()}) than this"
            f" run ({chunk.arithmetic}): its frames would differ",
            remedy="Use workers of one kind of processor and build (itmo-video --version), then run"
            " the same command again.",
        )
    clip = _clip(chunk)
    _sweep_once(chunk.output)
    plan = make_plan(clip, make_look(chunk.settings), chunk.run)
    shots = (ShotLook(first, last, make_look(own)) for first, last, own in chunk.shots)
    plan = replace(plan, shots=tuple(shots))
    folder = OutputFolder(chunk.output, plan.clip.stem)
    todo, _, concealed = ToMake(dict(plan.numbers))
    if not chunk.run.null:
        if read_manifest(chunk.output) is None:
            raise OutputError(
                f"the worker on {socket.gethostname()} cannot find the folder",
                where=chunk.output,
                remedy="All workers must see it under this path; then run the same command again.",
            )
        # A chunk whose worker died is sent again; frames finished by then are not rendered again.
        todo, _, concealed = frames_to_make(plan, folder, chunk.run)
    summary = Summary(len(plan.numbers), len(plan.numbers) - len(todo), damaged=[*concealed])
    ended = render_job(Job(clip, plan, folder, chunk.run, todo), summary, ignore)
    made = tuple(n for n in chunk.numbers if n not in set(summary.missing))
    return Outcome(
        made,
        tuple(summary.damaged),
        tuple(summary.missing),
        summary.bytes_written,
        summary.peak_nits or 0.0,
        tuple(ended),
    )


def try_chunk(chunk: Chunk) -> Outcome | ItmoError:
    """As make_chunk, with expected errors returned: Dask would log a raised one as a traceback."""
    try:
        return make_chunk(chunk)
    except ItmoError as error:
        return error


def dask_setup(worker: object) -> None:
    """Set up a worker process; Dask calls it, as this module is its `preload`.

    Ctrl-C in a terminal reaches all processes: the main one ends the others in order.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _own(plan: Plan, numbers: list[int]) -> tuple[tuple[int, int, Settings], ...]:
    """The shots of a chunk's frames."""
    first, last = plan.numbers[numbers[0]], plan.numbers[numbers[-1]]
    return tuple(
        (shot.first, shot.last, shot.look.settings)
        for shot in plan.shots
        if shot.last >= first and shot.first <= last
    )


def _clip(chunk: Chunk) -> Clip:
    options = input_options(chunk.settings, chunk.run.max_pixels)
    try:
        stat = os.stat(chunk.source)
    except OSError as error:
        raise InputError(
            f"the worker on {socket.gethostname()} cannot find it: {error.strerror}",
            where=chunk.source,
            remedy="All workers must see it under this path; then run the same command again.",
        ) from error
    clip = _open_once(chunk.source, options, stat.st_mtime_ns, stat.st_size)
    if clip.info.digest != chunk.digest:
        raise InputError(
            f"the worker on {socket.gethostname()} sees another file there",
            where=chunk.source,
            remedy="All workers must see the same one; then run the same command again.",
        )
    return clip


@functools.lru_cache(maxsize=2)  # opening reads all packets of a film, too expensive for each chunk
def _open_once(source: str, options: InputOptions, mtime: int, size: int) -> Clip:
    return open_clip(source, options)


@functools.lru_cache(maxsize=2)
def _sweep_once(output: str) -> None:
    """A worker that replaces a killed one cleans up after it; only its own machine can."""
    sweep_temp_files(output)
