"""Frames that a run leaves in its folder though they are not of its settings."""

from __future__ import annotations

from collections.abc import Iterable

from itmo_video.conversion.frame_ranges import format_ranges
from itmo_video.conversion.plan import Plan
from itmo_video.conversion.run_options import RunOptions
from itmo_video.output.folder import OutputFolder
from itmo_video.words import counted, cut

_NAMES_TOLD = 3


def left_frames(
    plan: Plan, folder: OutputFolder, run: RunOptions, made: Iterable[int]
) -> list[str]:
    """Notices about frames that a run with `update` or `overwrite` leaves as they were.

    `made` are numbers that need no look, as the run has made them. Frames outside of the clip, or
    with another clip's name, are of no settings that it could have.
    """
    if run.null or not (run.update or run.overwrite):
        return []
    first, own, numbers = plan.first_number, set(made), folder.frame_numbers()
    end = None if plan.source_frames is None else first + plan.source_frames
    inside = [n for n in numbers if n >= first and (end is None or n < end)]
    stated = folder.fingerprints([n for n in inside if n not in own], plan.jobs)
    others = [n for n, told in stated.items() if told not in (None, plan.fingerprint_at(n - first))]
    names = [folder.frame_path(n).name for n in sorted({*numbers} - {*inside})]
    names += folder.other_frames()
    notices = list[str]()
    if others:
        named = f"{counted(len(others), 'frame')} ({cut(format_ranges(others))})"
        notices.append(
            f"{named} {'keeps' if len(others) == 1 else 'keep'} other settings; the same command "
            "for all frames (without --frames) re-renders them"
        )
    if names:
        are = "is" if len(names) == 1 else "are"
        more = ", ..." if len(names) > _NAMES_TOLD else ""
        notices.append(
            f"{counted(len(names), 'EXR file')} in the folder {are} not of this conversion "
            f"({', '.join(names[:_NAMES_TOLD])}{more}); move or remove what is no longer needed"
        )
    return notices
