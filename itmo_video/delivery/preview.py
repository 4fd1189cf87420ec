"""Running a preview: from a clip or a converted folder to a film or a still.

A film is rendered once: workers render, measure and convert to codes, the calling thread encodes
them in order, and MaxCLL and MaxFALL are filled in in the finished file.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path

from itmo_video.conversion.run_options import RunOptions
from itmo_video.delivery.films import check_film_options, write_film
from itmo_video.delivery.from_clip import from_clip
from itmo_video.delivery.from_folder import from_folder
from itmo_video.delivery.idle_options import idle_options
from itmo_video.delivery.preview_options import PreviewOptions
from itmo_video.delivery.still_files import JPEG, STILLS, check_still_options, write_still
from itmo_video.delivery.views import check_view
from itmo_video.errors import DamagedInputError, UsageError
from itmo_video.events import Finished, OnEvent, Started, Warned, ignore
from itmo_video.options import checked, checked_path
from itmo_video.output.converted import open_converted
from itmo_video.output.gate import FILM, STILL, Gate
from itmo_video.output.manifest import read_manifest
from itmo_video.presets import as_settings
from itmo_video.settings import Settings
from itmo_video.source.opening import input_files
from itmo_video.source.pipe import is_pipe
from itmo_video.words import counted


@dataclass(frozen=True)
class PreviewSummary:
    """The result of a preview: frames, seconds taken, and the film's MaxCLL and MaxFALL in nits.

    >>> from itmo_video import preview
    >>> preview("clip.mkv", "film.mp4").frames
    3
    """

    frames: int
    seconds: float
    bytes_written: int
    max_cll: float
    max_fall: float


def preview(
    source: str | Path,
    output: str | Path,
    settings: Settings | str | None = None,
    run: RunOptions | None = None,
    options: PreviewOptions | None = None,
    on_event: OnEvent = ignore,
) -> PreviewSummary:
    """Write a film or a still from a clip, converted on the fly, or from a converted folder.

    A folder is shown as converted, and its source is read with the same settings; `settings` then
    raise UsageError. Raises the errors of itmo_video.errors, DamagedInputError only after all that
    can be decoded was written; OutputError before any work if `output` must not be overwritten
    (output.gate). `on_event` is called with Warned, Started, FrameDone and Finished.

    >>> from itmo_video import PreviewOptions, preview
    >>> preview("clip.mkv", "frame.jpg", options=PreviewOptions(frame=2)).frames
    1
    """
    options, run = checked(options, PreviewOptions, "options"), checked(run, RunOptions, "run")
    source, output = Path(checked_path(source, "source")), Path(checked_path(output, "output"))
    began = time.monotonic()
    is_still = output.suffix.lower() in STILLS
    is_flat = is_still and options.view is None and output.suffix.lower() not in JPEG
    options = replace(options, view=options.view or "hdr10")
    _check(output, options)
    if options.frame is not None:
        if run.frames is not None:
            raise UsageError("--frame and --frames cannot be combined", remedy="Omit one.")
        run = replace(run, frames=str(options.frame))
    gate = None if is_pipe(output) else _gate(source, output, options, run)
    if gate is not None:
        gate.check()
    used: Settings | None = None
    if source.is_dir():
        if settings is not None or run.analysis is not None:
            raise UsageError(
                "settings do not apply to a converted folder, which is shown as it was converted",
                where=str(source),
                remedy="Omit the settings and --analysis, or give the clip itself; for a "
                "darker display, use --display-peak N.",
            )
        clip = options.clip if options.view == "compare" or is_still else None
        converted = open_converted(source)
        if options.clip is not None and clip is None:  # for its sound
            converted.open_source(options.clip, run.max_pixels).close()
        pictures = from_folder(converted, clip, run)
        pictures.clip = options.clip
    else:
        used = as_settings(settings)
        pictures = from_clip(source, used, run)
    if options.view == "compare" and source.is_dir() and options.clip is None:
        raise UsageError("--as compare needs the source", remedy="Give it with --source CLIP.")
    for notice in (*pictures.notices, *idle_options(output, options, used)):
        on_event(Warned(notice))
    if is_flat:
        on_event(
            Warned("a PQ still: viewers that do not know PQ show it grey; --as sdr is for them")
        )
    on_event(Started(str(source), str(output), len(pictures.numbers), 0))
    if is_still:
        assert gate is not None
        if len(pictures.numbers) != 1:
            raise UsageError(
                f"{output.name} is a still, but there is more than one frame",
                remedy="Choose one with --frame N, or name a film, such as film.mp4.",
            )
        frames, light, size = 1, *write_still(pictures, gate, options, on_event)
    else:
        frames, light, size = write_film(pictures, output, gate, options, run, on_event)
    seconds = time.monotonic() - began
    summary = PreviewSummary(frames, seconds, size, light.peak, light.average)
    on_event(
        Finished(
            written=frames,
            present=0,
            seconds=summary.seconds,
            bytes_written=summary.bytes_written,
            max_cll=light.peak,
            max_fall=light.average,
        )
    )
    if told := [*pictures.damage, *pictures.damaged_in_words]:
        raise DamagedInputError(
            "; ".join(told),
            where=str(source),
            remedy=f"{counted(frames, 'frame')} shown.",
        )
    return summary


def _check(output: Path, options: PreviewOptions) -> None:
    suffix = output.suffix.lower()
    check_view(options)
    if suffix in STILLS:
        if is_pipe(output):
            raise UsageError(f"{output}: a still cannot go to a pipe", remedy="Name a file.")
        check_still_options(suffix, options)
    elif options.frame is not None:
        raise UsageError(
            f"{output.name}: --frame N writes a still",
            remedy=f"Stills end in {', '.join(STILLS)}; films in .mp4, .mov, .mkv, .y4m or are -.",
        )
    else:
        check_film_options(output, options)


def _gate(source: Path, output: Path, options: PreviewOptions, run: RunOptions) -> Gate:
    manifest = read_manifest(source) if source.is_dir() else None
    inputs = [] if is_pipe(source) else input_files(source)
    inputs += input_files(options.clip) if options.clip else []
    return Gate(
        output,
        STILL if output.suffix.lower() in STILLS else FILM,
        inputs=inputs,
        overwrite=run.overwrite,
        source_digest=manifest.source_digest if manifest else None,
    )
