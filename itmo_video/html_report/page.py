"""The edge of the report: a converted folder to one HTML file that needs nothing else."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from itmo_video.conversion.frame_ranges import format_ranges
from itmo_video.conversion.run_options import RunOptions
from itmo_video.delivery.from_folder import from_folder
from itmo_video.delivery.pictures import Picture, Pictures
from itmo_video.errors import UsageError
from itmo_video.events import FrameDone, OnEvent, Started, Warned, ignore
from itmo_video.html_report import embed, measure, plots
from itmo_video.html_report.measure import FilmFacts, Measured
from itmo_video.html_report.report_options import ReportOptions
from itmo_video.html_report.viewer_data import MAX_WIDTH, import_map, viewer_data
from itmo_video.options import checked, checked_path
from itmo_video.output.converted import Converted, open_converted, peak_nits_of
from itmo_video.output.gate import PAGE, Gate
from itmo_video.output.manifest import Manifest
from itmo_video.source.facts import clip_facts
from itmo_video.source.opening import input_files
from itmo_video.words import counted, to_install

MAX_FRAMES = 240
MOST_SHOTS = 40  # whose rendering is told
MAX_PICTURE_CHARACTERS = 13_500_000  # the page with its plots stays below 15 MB
REPORT_NAME = "report.html"


def report(
    folder: str | Path, options: ReportOptions | None = None, on_event: OnEvent = ignore
) -> Path:
    """Write the page about a converted folder and return its path (FOLDER/report.html).

    With the source clip it also compares with what was before. Raises InputError where there is no
    conversion, UsageError where the extra "report" is missing, and OutputError where the output may
    not be written over: a report at FOLDER/report.html may, all else only with `overwrite`.

    >>> from pathlib import Path
    >>> from itmo_video import ReportOptions, convert, report
    >>> _ = convert("clip.mkv", "out")
    >>> report("out", ReportOptions(clip=Path("clip.mkv"))).name
    'report.html'
    """
    require_templates()
    folder, options = (
        Path(checked_path(folder, "folder")),
        checked(options, ReportOptions, "options"),
    )
    converted, clip = open_converted(folder), options.clip
    gate = report_gate(folder, options, converted.manifest)
    gate.check()
    pictures = from_folder(converted, clip, RunOptions())
    for notice in pictures.notices:
        on_event(Warned(notice))
    on_event(Started(str(folder), str(gate.path), len(pictures.numbers), 0))
    facts, embedded = _measured(pictures, converted, on_event)
    told = _source_facts(clip, converted) + _renderings(facts, converted)
    text = render_page(converted, pictures, facts, embedded, told)
    gate.write(text.encode("utf-8", "backslashreplace"))
    return gate.path


def report_gate(folder: Path, options: ReportOptions, manifest: Manifest | None) -> Gate:
    """What stands in front of a report's file."""
    return Gate(
        options.output if options.output is not None else folder / REPORT_NAME,
        PAGE,
        inputs=input_files(options.clip) if options.clip is not None else (),
        overwrite=options.overwrite,
        source_digest=manifest.source_digest if manifest is not None else None,
        is_ours=options.output is None,
    )


def _measured(
    pictures: Pictures, converted: Converted, on_event: OnEvent
) -> tuple[FilmFacts, list[embed.Embedded]]:
    numbers, settings = pictures.numbers, converted.settings
    count = min(MAX_FRAMES, len(numbers))
    wanted = {numbers[round(i)] for i in np.linspace(0, len(numbers) - 1, count)}
    peak = pictures.peak_nits / pictures.white_nits
    shown: list[embed.Embedded] = []

    def work(picture: Picture) -> tuple[Measured, embed.Embedded | None]:
        own_peak = peak_nits_of(converted.settings_of(picture.number))
        told = measure.measure(
            picture, pictures.primaries, pictures.white_nits, own_peak, settings.map_width
        )
        if picture.number not in wanted:
            return told, None
        return told, embed.embed(picture, pictures.primaries, peak, MAX_WIDTH)

    def measured() -> Iterator[Measured]:
        for done, (told, picture) in enumerate(pictures.mapped(work), 1):
            if picture is not None:
                shown.append(picture)
            on_event(FrameDone(told.facts.number, done, len(numbers)))
            yield told

    facts = measure.film_facts(measured(), settings.key_reach)
    return facts, thinned(shown, MAX_PICTURE_CHARACTERS)


def thinned(shown: Sequence[embed.Embedded], most: int) -> list[embed.Embedded]:
    """Evenly fewer frames, so that they take `most` characters; at least one stays."""
    count = len(shown)
    while True:
        kept = [shown[round(i)] for i in np.linspace(0, len(shown) - 1, count)]
        if count <= 1 or sum(frame.length for frame in kept) <= most:
            return kept
        count -= 1


def render_page(
    converted: Converted,
    pictures: Pictures,
    facts: FilmFacts,
    embedded: Sequence[embed.Embedded],
    source_facts: Sequence[tuple[str, str]],
) -> str:
    """The page as text; every name and value is escaped by the template engine."""
    manifest = converted.manifest
    white, frames = pictures.white_nits, facts.frames
    viewer = viewer_data(embedded, [frame.number for frame in frames], pictures)
    shares = facts.histogram.tolist()
    bars = plots.bars(shares, measure.LOWEST_STOP, measure.BINS_A_STOP)
    return str(_templates().get_template("report.html.j2").render(
        source_name=manifest.source_name, headline=_headline(pictures), viewer=viewer,
        style=_raw("report.css"), script=_raw("report.js"), import_map=_markup(import_map()),
        shown_frames=format_ranges([e.number for e in embedded]), frame_count=len(frames),
        white_nits=f"{white:g}", levels=_levels(facts), plots=_plots(facts), bars=bars,
        tallest=f"{max(shares):.1%}", warnings=_warnings(facts, pictures, converted),
        facts=source_facts, settings=_settings_rows(converted),
    ))  # fmt: skip


def _headline(pictures: Pictures) -> str:
    width, height = pictures.size
    frames = counted(len(pictures.numbers), "frame")
    return (
        f"{frames} ({format_ranges(pictures.numbers)}), {width}x{height}, "
        f"{float(pictures.frame_rate):g} frames a second, white {pictures.white_nits:g} nits, "
        f"peak {pictures.peak_nits:g} nits"
    )


def _levels(facts: FilmFacts) -> list[tuple[str, str]]:
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


def _plots(facts: FilmFacts) -> list[plots.Drawn]:
    frames = facts.frames
    numbers = [frame.number for frame in frames]
    at = {frame.index: i for i, frame in enumerate(frames)}
    cuts, keys = ([at[i] for i in indices if i in at] for indices in (facts.cuts, facts.keys))
    light = [
        plots.Line("maximum", [f.maximum for f in frames]),
        plots.Line("99th percentile", [f.percentiles[3] for f in frames]),
        plots.Line("90th percentile", [f.percentiles[2] for f in frames]),
        plots.Line("average", [f.mean for f in frames]),
        plots.Line("median", [f.percentiles[1] for f in frames]),
        plots.Line("1st percentile", [f.percentiles[0] for f in frames]),
    ]
    out = [plots.Plot("Luminance", "nits", light, numbers, cuts, keys, is_log=True)]
    if all(f.coverage is not None for f in frames):
        coverage = [100 * (f.coverage or 0.0) for f in frames]
        out.append(plots.Plot("Expand Map coverage", "% of the frame, by weight",
                              [plots.Line("coverage", coverage)], numbers, cuts, keys))  # fmt: skip
    if facts.map_flicker is not None:
        line = plots.Line("map, change along the motion", facts.map_flicker)
        out.append(plots.Plot("Map flicker", "0 to 1", [line], numbers, cuts, keys))
    if facts.gain_flicker is not None:
        line = plots.Line("gain, change along the motion", facts.gain_flicker)
        out.append(plots.Plot("Gain flicker", "stops", [line], numbers, cuts, keys))
    return [plots.draw(plot) for plot in out]


def _warnings(facts: FilmFacts, pictures: Pictures, converted: Converted) -> list[str]:
    frames, out = facts.frames, list(pictures.damage)
    if converted.absent:
        out.append(f"Frames {converted.absent} are not in the folder.")
    if broken := [f.number for f in frames if f.not_finite]:
        out.append(f"Frames {format_ranges(broken)} hold values that are not finite.")
    if clipped := [f.number for f in frames if f.at_peak > 0.02]:
        out.append(
            f"More than 2 % of the picture is at the peak in frames {format_ranges(clipped)}: "
            "large areas clip there."
        )
    if facts.light.average > 400:
        out.append(
            f"MaxFALL is {facts.light.average:.0f} nits: televisions dim pictures above about 400."
        )
    if pictures.clip is None:
        source = converted.manifest.source_name
        out.append(
            f"The source was not given (report --source {source}), so there is no before and "
            "after, and cuts are those seen in the result."
        )
    if "expand_map" not in converted.settings.layers:
        out.append("The Expand Map was not stored (convert --layers expand_map).")
    return out


def _source_facts(clip: str | Path | None, converted: Converted) -> list[tuple[str, str]]:
    if clip is None:
        return [("source", "not given to this report")]
    with converted.open_source(Path(clip)) as opened:
        told = clip_facts(opened.info) | {"remarks": list(opened.info.notices)}
    rows: list[tuple[str, str]] = []
    for name, value in told.items():
        if name != "path":
            rows.append((str(name).replace("_", " "), _told(value)))
    return rows


def _renderings(facts: FilmFacts, converted: Converted) -> list[tuple[str, str]]:
    """How the shots were rendered to SDR and what was done, of those the operator asks it for."""
    rows = []
    for shot in facts.shots:
        settings = converted.settings_of(shot.first)
        if settings.operator == "auto":
            found = replace(shot.rendering, footage=settings.footage)
            frames = format_ranges(range(shot.first, shot.last + 1))
            rows.append((f"rendering, frames {frames}", found.in_words(settings.l_max_effective)))
    more = len(rows) - MOST_SHOTS
    return rows if more <= 0 else [*rows[:MOST_SHOTS], ("rendering", f"{more} more shots")]


def _settings_rows(converted: Converted) -> list[tuple[str, str]]:
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
    if isinstance(value, dict):
        return ", ".join(f"{k} {_told(v)}" for k, v in value.items()) or "none"
    if isinstance(value, list | tuple):
        return ", ".join(_told(v) for v in value) or "none"
    return f"{value:g}" if isinstance(value, float) else json.dumps(value, default=str)


def _raw(name: str) -> Any:
    """Our own style or script."""
    template = resources.files("itmo_video.html_report").joinpath("template", name)
    return _markup(template.read_text("utf-8"))


def _markup(text: str) -> Any:
    """Text of our own, which is not escaped."""
    from markupsafe import Markup

    return Markup(text)


def require_templates() -> None:
    """Raise UsageError where the extra "report" is missing: to be known before the work."""
    _templates()


def _templates() -> Any:
    try:
        import jinja2
    except ImportError as error:
        raise UsageError(
            "reports need the template engine jinja2, which is not installed",
            remedy=to_install("report"),
        ) from error
    return jinja2.Environment(
        loader=jinja2.PackageLoader("itmo_video.html_report", "template"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
    )
