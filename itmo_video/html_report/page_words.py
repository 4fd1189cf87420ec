"""The report's texts: headline, levels, warnings, facts and settings."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from itmo_video.conversion.frame_ranges import format_ranges
from itmo_video.delivery.pictures import Pictures
from itmo_video.html_report.measure import FilmFacts
from itmo_video.output.converted import Converted
from itmo_video.source.facts import clip_facts
from itmo_video.words import counted, frames_are

MOST_SHOTS = 40  # whose rendering is listed


def headline(pictures: Pictures) -> str:
    """The line below the title."""
    width, height = pictures.size
    frames = counted(len(pictures.numbers), "frame")
    return (
        f"{frames} ({format_ranges(pictures.numbers)}), {width}x{height}, "
        f"{float(pictures.frame_rate):g} fps, white {pictures.white_nits:g} nits, "
        f"peak {pictures.peak_nits:g} nits"
    )


def levels(facts: FilmFacts) -> list[tuple[str, str]]:
    """The rows of light levels and counts."""
    frames = facts.frames
    mean = float(np.mean([frame.mean for frame in frames]))
    return [
        ("MaxCLL", f"{facts.light.peak:.1f} nits"),
        ("MaxFALL", f"{facts.light.average:.1f} nits"),
        ("Highest luminance", f"{max(frame.maximum for frame in frames):.1f} nits"),
        ("Mean luminance", f"{mean:.2f} nits"),
        ("Cuts", str(len(facts.cuts))),
        ("Keyframes", str(len(facts.keys))),
    ]


def warnings(facts: FilmFacts, pictures: Pictures, converted: Converted) -> list[str]:
    """Warnings about what deserves a second look."""
    frames, out = facts.frames, list(pictures.damage)
    if converted.absent:
        out.append(f"{frames_are(converted.absent).capitalize()} not in the folder.")
    if broken := [f.number for f in frames if f.not_finite]:
        out.append(f"Frames {format_ranges(broken)} contain infinite or NaN values.")
    if clipped := [f.number for f in frames if f.at_peak > 0.02]:
        out.append(
            f"In frames {format_ranges(clipped)} more than 2 % of the picture is at the peak: "
            "large areas are clipped."
        )
    if facts.light.average > 400:
        out.append(
            f"MaxFALL is {facts.light.average:.0f} nits: TVs dim pictures above about 400 nits."
        )
    if pictures.clip is None:
        source = converted.manifest.source_name
        out.append(
            f"The source was not given (report --source {source}), so there is no before/after "
            "comparison, and cuts are detected in the result."
        )
    if "expand_map" not in converted.settings.layers:
        out.append("The Expand Map is not stored; to see it, convert with --layers expand_map.")
    return out


def source_facts(
    clip: str | Path | None, converted: Converted, max_pixels: int
) -> list[tuple[str, str]]:
    """The rows of the source's metadata."""
    if clip is None:
        return [("source", "not given to this report")]
    with converted.open_source(Path(clip), max_pixels) as opened:
        told = clip_facts(opened.info) | {"remarks": list(opened.info.notices)}
    rows: list[tuple[str, str]] = []
    for name, value in told.items():
        if name != "path":
            rows.append((str(name).replace("_", " "), _told(value)))
    return rows


def renderings(facts: FilmFacts, converted: Converted) -> list[tuple[str, str]]:
    """The shots' estimated rendering to SDR and its handling, for operators that use it."""
    rows = []
    for shot in facts.shots:
        settings = converted.settings_of(shot.first)
        if settings.operator == "auto":
            found = replace(shot.rendering, footage=settings.footage)
            frames = format_ranges(range(shot.first, shot.last + 1))
            rows.append((f"rendering, frames {frames}", found.in_words(settings.l_max_effective)))
    more = len(rows) - MOST_SHOTS
    return rows if more <= 0 else [*rows[:MOST_SHOTS], ("rendering", f"{more} more shots")]


def settings_rows(converted: Converted) -> list[tuple[str, str]]:
    """The rows of the settings, and of settings of single shots."""
    rows = [
        (name.replace("_", "-"), _told(value))
        for name, value in converted.manifest.settings.items()
        if name != "shots"
    ]
    common = converted.settings.as_dict()
    for shot in converted.shots:
        first, last = (converted.first_number + index for index in (shot.first, shot.last))
        own = {n: v for n, v in shot.settings.as_dict().items() if v != common[n]}
        told = ", ".join(f"{n.replace('_', '-')} {_told(v)}" for n, v in own.items())
        rows.append((f"frames {format_ranges(range(first, last + 1))}", told))
    return rows


def _told(value: object) -> str:
    if value is None or isinstance(value, bool):
        return {None: "none", True: "yes", False: "no"}[value]
    if isinstance(value, str):
        return value
    if isinstance(value, dict) and set(value) == {"value", "from"}:
        return f"{_told(value['value'])} ({value['from']})"
    if isinstance(value, dict):
        return ", ".join(f"{k} {_told(v)}" for k, v in value.items()) or "none"
    if isinstance(value, list | tuple):
        return ", ".join(_told(v) for v in value) or "none"
    return f"{value:g}" if isinstance(value, float) else json.dumps(value, default=str)
