"""One clip to one folder of EXR files: plan, claim the folder, render what is missing, report."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

from itmo_video import colour, exr, pipeline, timecode
from itmo_video.errors import CheckFailedError, DamagedInputError, OutputError, UsageError
from itmo_video.folder import Manifest, OutputFolder
from itmo_video.frame_ranges import format_ranges, parse_ranges
from itmo_video.model import ClipInfo, Frame
from itmo_video.reader import Clip, open_clip
from itmo_video.render import Look, Rendered, make_look
from itmo_video.settings import Settings
from itmo_video.tags import InputOptions

ALGORITHM = 1  # raise it whenever the same settings give other pixels

Event = Mapping[str, Any]


@dataclass(frozen=True)
class RunOptions:
    """How a conversion is run; nothing of it changes a frame's bytes."""

    frames: str | None = None
    start_number: int = 1
    jobs: int | None = None
    overwrite: bool = False
    update: bool = False
    durable: bool = False
    null: bool = False
    max_pixels: int = 2**27


@dataclass
class Summary:
    """What a conversion did."""

    wanted: int
    present: int
    written: int = 0
    missing: list[int] = field(default_factory=list)
    damaged: list[int] = field(default_factory=list)
    seconds: float = 0.0
    bytes_written: int = 0


@dataclass(frozen=True)
class Plan:
    """What a conversion would do: frames by number, and the folder and fingerprints they go by."""

    clip: ClipInfo
    settings: Settings
    numbers: Mapping[int, int]  # file number -> index
    first_number: int
    memory_bytes: int
    jobs: int

    def fingerprint(self, number: int) -> str:
        """What the pixels of a frame depend on: settings, source content, index, algorithm."""
        settings = {**self.settings.as_dict(), "source": self.clip.digest, "algorithm": ALGORITHM}
        text = json.dumps([settings, self.numbers[number]], sort_keys=True)
        return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()

    @property
    def manifest(self) -> Manifest:
        """Whose the output folder is."""
        settings = {**self.settings.as_dict(), "first_number": self.first_number}
        return Manifest(Path(self.clip.path).name, self.clip.digest, self.clip.stem, settings)


def input_options(settings: Settings, max_pixels: int = 2**27) -> InputOptions:
    """The part of the settings that says how the source is read."""
    return InputOptions(
        transfer=settings.transfer,
        matrix=settings.matrix,
        range=settings.range,
        force_sdr=settings.force_sdr,
        deinterlace=settings.deinterlace,
        max_pixels=max_pixels,
        fps=settings.frame_rate,
    )


def make_plan(clip: Clip, look: Look, run: RunOptions) -> Plan:
    """Resolve ranges and numbers; raises UsageError where a range lies outside the clip."""
    info = clip.info
    first = info.first_number if info.first_number is not None else run.start_number
    numbers = {first + index: index for index in range(info.frames)}
    if run.frames is not None:
        asked = parse_ranges(run.frames)
        if outside := [n for n in asked if n not in numbers]:
            raise UsageError(
                f"frames {format_ranges(outside)} are not in the clip",
                where=info.path,
                remedy=f"It has {first}-{first + info.frames - 1}.",
            )
        numbers = {n: numbers[n] for n in asked}
    jobs = run.jobs or pipeline.default_jobs()
    width, height = info.display_size
    wide = 1 if info.encoding.bit_depth == 8 else 2
    memory = pipeline.memory_bound_bytes(width, height, wide, look, jobs)
    return Plan(info, look.settings, numbers, first, memory, jobs)


def convert(
    source: str | Path,
    output: str | Path,
    settings: Settings | None = None,
    run: RunOptions | None = None,
    on_event: Callable[[Event], None] = lambda event: None,
) -> Summary:
    """Convert a clip to an EXR sequence OUTPUT/<stem>.%04d.exr; what is there already stays.

    Raises the errors of itmo_video.errors; DamagedInputError only after all that decodes was
    written. `on_event` is called with dicts that have "event": started, frame, warning, finished;
    frames come from worker threads, one at a time.
    """
    settings, run = settings or Settings(), run or RunOptions()
    look = make_look(settings)
    began = time.monotonic()
    with open_clip(source, input_options(settings, run.max_pixels)) as clip:
        plan = make_plan(clip, look, run)
        folder = OutputFolder(output, plan.clip.stem)
        for notice in plan.clip.notices:
            on_event({"event": "warning", "message": notice})
        todo = dict(plan.numbers)
        if not run.null:
            folder.claim(plan.manifest, overwrite=run.overwrite, update=run.update)
            folder.sweep_temp_files()
            todo = _missing(plan, folder, run)
        summary = Summary(len(plan.numbers), len(plan.numbers) - len(todo))
        on_event(
            {"event": "started", "input": plan.clip.path, "output": str(output),
             "frames": summary.wanted, "present": summary.present}
        )  # fmt: skip
        ended = _render(clip, plan, folder, todo, look, run, summary, on_event)
    summary.seconds = time.monotonic() - began
    on_event({"event": "finished", **dataclasses.asdict(summary)})
    cut_short = (plan.clip.frames_declared or 0) - plan.clip.frames if run.frames is None else 0
    if ended or summary.missing or summary.damaged or cut_short > 0:
        raise _damage(plan, summary, ended, cut_short)
    return summary


def _missing(plan: Plan, folder: OutputFolder, run: RunOptions) -> dict[int, int]:
    """The frames still to be made, by number; raises OutputError for another settings' frames."""
    if run.overwrite:
        return dict(plan.numbers)
    states = {n: folder.state(n, plan.fingerprint(n)) for n in plan.numbers}
    others = [n for n, state in states.items() if state == "other"]
    if others and not run.update:
        raise OutputError(
            f"frames {format_ranges(others)} were made with other settings",
            where=str(folder.path),
            remedy="--update makes them again; or choose another folder.",
        )
    return {n: i for n, i in plan.numbers.items() if states[n] != "whole"}


def _render(
    clip: Clip,
    plan: Plan,
    folder: OutputFolder,
    todo: Mapping[int, int],
    look: Look,
    run: RunOptions,
    summary: Summary,
    on_event: Callable[[Event], None],
) -> list[DamagedInputError]:
    by_index = {index: number for number, index in todo.items()}
    lock = threading.Lock()

    def sink(frame: Frame, rendered: Rendered) -> None:
        number = by_index[frame.index]
        size = 0
        if not run.null:
            size = exr.write_exr(
                folder.frame_path(number),
                rendered.rgb,
                exr_header(plan, number, frame.time_s),
                alpha=rendered.alpha,
                layers=rendered.layers,
                durable=run.durable,
            )
        with lock:
            by_index.pop(frame.index)
            summary.written += 1
            summary.bytes_written += size
            if frame.is_damaged:
                summary.damaged.append(number)
            on_event({"event": "frame", "number": number, "done": summary.written, "of": len(todo)})

    ended = pipeline.render_frames(clip, sorted(by_index), look, plan.jobs, sink)
    summary.missing = sorted(by_index.values())
    summary.damaged.sort()
    return ended


def exr_header(plan: Plan, number: int, time_s: Fraction) -> exr.ExrHeader:
    """The header of one frame's file."""
    settings, info = plan.settings, plan.clip
    chromaticities = colour.CHROMATICITIES[settings.primaries]
    code = None
    if info.timecode is not None:
        code = timecode.advance(info.timecode, plan.numbers[number], info.frame_rate)
    return exr.ExrHeader(
        compression=settings.compression,
        chromaticities=(
            chromaticities[0], chromaticities[1], chromaticities[2], chromaticities[3],
            chromaticities[4], chromaticities[5], chromaticities[6], chromaticities[7],
        ),
        white_nits=settings.white_nits,
        frame_rate=info.frame_rate,
        pixel_aspect=info.pixel_aspect,
        time_s=time_s,
        source_name=Path(info.path).name,
        fingerprint=plan.fingerprint(number),
        settings_text=json.dumps(settings.as_dict(), sort_keys=True),
        timecode=code,
        # SMPTE ST 2065-4 wants AP0, uncompressed half, and nothing but the picture.
        is_aces_container=settings.primaries == "aces2065-1"
        and settings.compression == "none"
        and not settings.layers,
    )  # fmt: skip


def _damage(
    plan: Plan, summary: Summary, ended: list[DamagedInputError], cut_short: int
) -> DamagedInputError:
    told = [error.what for error in ended]
    if summary.missing:
        told.append(f"frames {format_ranges(summary.missing)} could not be decoded")
    if summary.damaged:
        told.append(f"frames {format_ranges(summary.damaged)} are damaged in the source")
    if cut_short > 0:
        told.append(f"the file is cut short: {cut_short} frames are missing at its end")
    return DamagedInputError(
        "; ".join(told),
        where=plan.clip.path,
        remedy=f"All that decodes was converted: {summary.written + summary.present} frames.",
    )


def describe_plan(
    source: str | Path, output: str | Path, settings: Settings, run: RunOptions
) -> str:
    """What a conversion would do, in a few lines; raises what `convert` would, writes nothing."""
    look = make_look(settings)
    with open_clip(source, input_options(settings, run.max_pixels)) as clip:
        plan = make_plan(clip, look, run)
    OutputFolder(output, plan.clip.stem).check(
        plan.manifest, overwrite=run.overwrite, update=run.update
    )
    interval = settings.key_reach
    keys = {i - i % interval for i in plan.numbers.values()}
    width, height = plan.clip.display_size
    return (
        f"{len(plan.numbers)} frames ({format_ranges(plan.numbers)}) of {width}x{height}\n"
        f"{len(keys)} keyframes on the grid of {interval}, and two more at each cut\n"
        f"at most {plan.memory_bytes / 1e6:.0f} MB of memory with {plan.jobs} jobs"
    )


def verify(
    source: str | Path, output: str | Path, settings: Settings, run: RunOptions
) -> list[tuple[Path, str]]:
    """Check a folder against what a conversion would have made; (path, problem) for each fault."""
    look = make_look(settings)
    with open_clip(source, input_options(settings, run.max_pixels)) as clip:
        plan = make_plan(clip, look, run)
    folder = OutputFolder(output, plan.clip.stem)
    return folder.verify({n: plan.fingerprint(n) for n in plan.numbers})


def require_sound(faults: list[tuple[Path, str]]) -> None:
    """Raise CheckFailedError that names each fault, if there is any."""
    if faults:
        raise CheckFailedError("\n".join(f"{path}: {problem}" for path, problem in faults))
