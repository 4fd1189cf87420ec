"""Describing what a conversion would do, and verifying a folder."""

from __future__ import annotations

from pathlib import Path

from itmo_video.conversion.convert import (
    ToMake,
    folder_shortage,
    frames_to_make,
    rendered_otherwise,
)
from itmo_video.conversion.frame_ranges import damage_in_words, format_ranges
from itmo_video.conversion.left_frames import left_frames
from itmo_video.conversion.plan import keys_on_grid, make_plan
from itmo_video.conversion.run_options import RunOptions
from itmo_video.errors import CheckFailedError, OutputError
from itmo_video.events import OnEvent, Warned, ignore
from itmo_video.look import make_look
from itmo_video.output import disk_space
from itmo_video.output.exr_fingerprint import states_damage
from itmo_video.output.folder import OutputFolder
from itmo_video.settings import Settings
from itmo_video.source.opening import input_options, open_clip
from itmo_video.words import counted, missing


def describe_plan(
    source: str | Path, output: str | Path, settings: Settings, run: RunOptions
) -> str:
    """Describe a conversion in a few lines; raises what `convert` raises, writes nothing."""
    with open_clip(source, input_options(settings, run.max_pixels)) as clip:
        plan = make_plan(clip, make_look(settings), run)
    folder = OutputFolder(output, plan.clip.stem)
    if not run.null:
        folder.check(plan.manifest, overwrite=run.overwrite, update=run.update)
    todo, others, _ = ToMake(dict(plan.numbers)) if run.null else frames_to_make(plan, folder, run)
    if others:
        raise rendered_otherwise(others, folder)
    width, height = plan.clip.display_size
    needed = 0 if run.null else len(todo) * plan.estimated_frame_bytes
    frames = counted(len(plan.numbers), "frame")
    keys = counted(len(keys_on_grid(plan)), "keyframe")
    lines = [
        f"{frames} ({format_ranges(plan.numbers)}) of {width}x{height}, "
        f"{len(plan.numbers) - len(todo)} of them already present",
        f"{keys} at an interval of {plan.settings.key_reach}, and two more at each cut",
        f"at most {plan.memory_bytes / 1e6:.0f} MB of memory with {counted(plan.jobs, 'job')}",
        f"about {disk_space.in_words(needed)} of disk space, "
        f"{disk_space.in_words(disk_space.free_bytes(folder.path))} free",
    ]
    if plan.shots:
        lines.append(f"{counted(len(plan.shots), 'shot')} with their own settings")
    lines += [f"notice: {left}" for left in left_frames(plan, folder, run, plan.numbers)]
    if not run.null and (short := folder_shortage(plan, folder, len(todo))):
        lines.append(f"warning: {short}")
    return "\n".join(lines)


def verify(
    source: str | Path,
    output: str | Path,
    settings: Settings,
    run: RunOptions,
    on_event: OnEvent = ignore,
) -> list[tuple[Path, str]]:
    """Check a folder against a planned conversion; (path, problem) for each fault.

    If there are any, and the folder was made with other settings, these come first. `on_event`
    is called with Warned if the source is damaged, which is no fault of the folder.
    """
    with open_clip(source, input_options(settings, run.max_pixels)) as clip:
        plan = make_plan(clip, make_look(settings), run)
    folder = OutputFolder(output, plan.clip.stem)
    faults = folder.verify({n: plan.fingerprint(n) for n in plan.numbers}, plan.jobs, plan.form)
    if run.frames is None:
        strange = sorted({*folder.frame_numbers()} - {*plan.numbers})
        faults += [(folder.frame_path(n), "no frame of this clip; move it away") for n in strange]
    if faults:
        try:
            folder.check(plan.manifest)
        except OutputError as error:  # a flag of the conversion was left out, most likely
            faults.insert(0, (folder.path, error.what))
    if run.frames is None and plan.clip.frames_cut_off:
        lost = missing(plan.clip.frames_cut_off, "frame")
        on_event(Warned(f"the source is truncated or damaged: {lost}"))
    damaged = (n for n in plan.numbers if states_damage(folder.frame_path(n)))
    for told in damage_in_words(damaged):
        on_event(Warned(told))
    return faults


def require_sound(faults: list[tuple[Path, str]]) -> None:
    """Raise CheckFailedError that names the faults, if there is any: frames of a kind together."""
    alike: dict[tuple[str, str], list[Path]] = {}
    for path, problem in faults:
        alike.setdefault((path.suffix, problem), []).append(path)
    if faults:
        raise CheckFailedError(
            "\n".join(f"{_named(paths)}: {problem}" for (_, problem), paths in alike.items()),
            remedy="Verify with all flags of the conversion. "
            "The command without --verify renders what is missing or damaged.",
        )


def _named(paths: list[Path]) -> str:
    """One file by its path, several frames by their numbers."""
    if len(paths) == 1:
        return str(paths[0])
    numbers = format_ranges(int(path.name.split(".")[-2]) for path in paths)
    return f"{paths[0].parent}: frames {numbers}"
