"""Frames that a run leaves in its folder though they are not of its settings."""

from __future__ import annotations

from collections.abc import Iterable

from itmo_video.conversion.frame_ranges import format_ranges
from itmo_video.conversion.plan import Plan
from itmo_video.conversion.run_options import RunOptions
from itmo_video.output.folder import OutputFolder
from itmo_video.words import counted, cut

_NAMES_TOLD = 3
_RANGES_TOLD = 60  # characters that can be typed again


def left_frames(
    plan: Plan,
    folder: OutputFolder,
    run: RunOptions,
    made: Iterable[int],
    frames_read: int | None = None,
) -> list[str]:
    """Notices about frames that a run with `update` or `overwrite` leaves as they were.

    `made` are numbers that need no look, as the run has made them. Frames outside of the clip, of
    `frames_read` frames if it came by a pipe, or with another clip's name, are of no settings that
    it could have.
    """
    if run.null or not (run.update or run.overwrite):
        return []
    first, own, numbers = plan.first_number, set(made), folder.frame_numbers()
    frames = plan.source_frames if frames_read is None else frames_read
    end = None if frames is None else first + frames
    inside = [n for n in numbers if n >= first and (end is None or n < end)]
    stated = folder.fingerprints([n for n in inside if n not in own], plan.jobs)
    others = [n for n, told in stated.items() if told not in (None, plan.fingerprint_at(n - first))]
    names = [folder.frame_path(n).name for n in sorted({*numbers} - {*inside})]
    names += folder.other_frames()
    notices = list[str]()
    if others:
        is_are = "is" if len(others) == 1 else "are"
        notices.append(
            f"{counted(len(others), 'frame')} ({cut(format_ranges(others))}) {is_are} of other "
            f"settings or another source; {_remedy(plan, run, format_ranges(others))}"
        )
    if names:
        are = "is" if len(names) == 1 else "are"
        more = ", ..." if len(names) > _NAMES_TOLD else ""
        notices.append(
            f"{counted(len(names), 'EXR file')} in the folder {are} not of this conversion "
            f"({', '.join(names[:_NAMES_TOLD])}{more}); move or remove what is no longer needed"
        )
    return notices


def _remedy(plan: Plan, run: RunOptions, ranges: str) -> str:
    """What to do about frames that this run did not select, or could not make."""
    if run.frames is None:
        return "this run could not replace them: move or remove them"
    if plan.source_frames is None:  # a pipe
        return "convert the whole stream with --overwrite, or remove them"
    if len(ranges) <= _RANGES_TOLD:
        return f"the same command with --frames {ranges} re-renders them"
    return "the same command for all frames (without --frames) re-renders them"
