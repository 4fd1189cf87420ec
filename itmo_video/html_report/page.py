"""Writing the report: from a converted folder to one self-contained HTML file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from itmo_video.conversion.frame_ranges import format_ranges
from itmo_video.conversion.run_options import RunOptions
from itmo_video.delivery.aces import aces_sdr_table
from itmo_video.delivery.from_folder import from_folder
from itmo_video.delivery.pictures import Picture, Pictures
from itmo_video.errors import UsageError
from itmo_video.events import FrameDone, OnEvent, Started, Warned, ignore
from itmo_video.html_report import embed, measure, page_words, plots
from itmo_video.html_report.measure import FilmFacts, Measured
from itmo_video.html_report.report_options import ReportOptions
from itmo_video.html_report.viewer_data import MAX_WIDTH, import_map, viewer_data
from itmo_video.options import checked, checked_path
from itmo_video.output.converted import Converted, open_converted, peak_nits_of
from itmo_video.output.gate import PAGE, Gate
from itmo_video.output.manifest import Manifest
from itmo_video.source.opening import input_files
from itmo_video.words import to_install

MAX_FRAMES = 240
MAX_PICTURE_CHARACTERS = 13_500_000  # keeps the page, with its plots, below 15 MB
REPORT_NAME = "report.html"


def report(
    folder: str | Path, options: ReportOptions | None = None, on_event: OnEvent = ignore
) -> Path:
    """Write the page about a converted folder and return its path (FOLDER/report.html).

    With the source clip it also shows before and after. Raises InputError if there is no
    conversion, UsageError if the extra "report" is not installed, and OutputError if the output
    exists: an old report at FOLDER/report.html is replaced, anything else only with `overwrite`.

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
    pictures = from_folder(converted, clip, RunOptions(max_pixels=options.max_pixels))
    for notice in pictures.notices:
        on_event(Warned(notice))
    on_event(Started(str(folder), str(gate.path), len(pictures.numbers), 0))
    facts, embedded = _measured(pictures, converted, on_event)
    told = [
        *page_words.source_facts(clip, converted, options.max_pixels),
        *page_words.renderings(facts, converted),
    ]
    text = render_page(converted, pictures, facts, embedded, told)
    gate.write(text.encode("utf-8", "backslashreplace"))
    return gate.path


def report_gate(folder: Path, options: ReportOptions, manifest: Manifest | None) -> Gate:
    """Where a report goes, and what it may replace there: an old report at FOLDER/report.html."""
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
    """Thin out frames evenly so that they take at most `most` characters; keeps at least one."""
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
    """The page as text; the template engine escapes every name and value."""
    manifest = converted.manifest
    white, frames = pictures.white_nits, facts.frames
    aces = aces_sdr_table()
    viewer = viewer_data(embedded, [frame.number for frame in frames], pictures)
    shares = facts.histogram.tolist()
    bars = plots.bars(shares, measure.LOWEST_STOP, measure.BINS_A_STOP)
    return str(_templates().get_template("report.html.j2").render(
        source_name=manifest.source_name, headline=page_words.headline(pictures), viewer=viewer,
        style=_raw("report.css"), script=_raw("report.js"), import_map=_markup(import_map(aces)),
        has_aces=aces is not None,
        shown_frames=format_ranges([e.number for e in embedded]), frame_count=len(frames),
        white_nits=f"{white:g}", levels=page_words.levels(facts), plots=_plots(facts), bars=bars,
        tallest=f"{max(shares):.1%}", warnings=page_words.warnings(facts, pictures, converted),
        facts=source_facts, settings=page_words.settings_rows(converted),
    ))  # fmt: skip


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
        line = plots.Line("map, change along motion", facts.map_flicker)
        out.append(plots.Plot("Map flicker", "0 to 1", [line], numbers, cuts, keys))
    if facts.gain_flicker is not None:
        line = plots.Line("gain, change along motion", facts.gain_flicker)
        out.append(plots.Plot("Gain flicker", "stops", [line], numbers, cuts, keys))
    return [plots.draw(plot) for plot in out]


def _raw(name: str) -> Any:
    """The text of our style sheet or script."""
    template = resources.files("itmo_video.html_report").joinpath("template", name)
    return _markup(template.read_text("utf-8"))


def _markup(text: str) -> Any:
    """Our own text, which needs no escaping."""
    from markupsafe import Markup

    return Markup(text)


def require_templates() -> None:
    """Raise UsageError, before any work is done, if the extra "report" is not installed."""
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
