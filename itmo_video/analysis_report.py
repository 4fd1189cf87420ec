"""`analyse` at the terminal: the JSON to a file or standard output, the findings in words."""

from __future__ import annotations

import os
import sys

from itmo_video.analysis import Analysis
from itmo_video.atomic import write_whole
from itmo_video.clip_analysis import analyse
from itmo_video.errors import OutputError
from itmo_video.settings import Settings


def analyse_to(
    source: str,
    output: str | None,
    settings: Settings,
    start_number: int,
    max_pixels: int,
    *,
    overwrite: bool,
    quiet: bool,
) -> None:
    """Analyse `source` and write the JSON to `output`, None for standard output.

    Raises OutputError where a file is there already (shots edited by hand are dear), unless
    `overwrite` is given.
    """
    if output is not None and not overwrite and os.path.lexists(output):
        raise OutputError(
            "is there already, perhaps with shots edited by hand",
            where=output,
            remedy="Choose another name, or --overwrite.",
        )

    def on_warning(message: str) -> None:
        if not quiet:
            print(f"itmo-video: {message}", file=sys.stderr)

    analysis = analyse(
        source, settings, start_number=start_number, max_pixels=max_pixels, on_warning=on_warning
    )
    if output is None:
        print(analysis.to_json(), end="")
        return
    write_whole(output, analysis.to_json().encode())
    print(in_words(analysis))


def in_words(analysis: Analysis) -> str:
    """The findings in a few lines."""
    statistics, bars = analysis.statistics, analysis.bars
    lines = [
        f"{analysis.frames} frames, {len(analysis.shots)} shots, "
        f"{len(analysis.keyframes)} keyframes",
        f"luminance: mean {statistics.mean:.3f}, median {statistics.p50:.3f}, "
        f"99 % {statistics.p99:.3f}; {statistics.clipped:.2%} clipped",
    ]
    if any((bars.left, bars.right, bars.top, bars.bottom)):
        lines.append(
            f"black bars: left {bars.left}, right {bars.right}, top {bars.top}, "
            f"bottom {bars.bottom} pixels"
        )
    lines += [f"suggested: {s.setting} = {s.value} ({s.reason})" for s in analysis.suggestions]
    return "\n".join(lines)
