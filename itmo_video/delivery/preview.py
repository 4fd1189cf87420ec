"""The edge of delivery: a clip or a converted folder to a film or a still to look at.

A film costs one rendering: workers render, measure and convert to codes, the calling thread encodes
them in order, and MaxCLL and MaxFALL are completed in the finished file.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path

from itmo_video.colour.primaries import CHROMATICITIES
from itmo_video.conversion.run_options import RunOptions
from itmo_video.delivery import encode, hdr, stills
from itmo_video.delivery.films import check_film_options, crf_of, write_film
from itmo_video.delivery.from_clip import from_clip
from itmo_video.delivery.from_folder import from_folder
from itmo_video.delivery.hdr import Light
from itmo_video.delivery.metadata import Mastering
from itmo_video.delivery.pictures import Picture, Pictures
from itmo_video.delivery.preview_options import PreviewOptions
from itmo_video.delivery.views import light_of, sdr_view, signal_of
from itmo_video.delivery.y4m import is_stream_output
from itmo_video.errors import DamagedInputError, UsageError
from itmo_video.events import Finished, OnEvent, Started, Warned, ignore
from itmo_video.output.converted import open_converted
from itmo_video.output.folder import read_manifest
from itmo_video.output.gate import FILM, STILL, Gate
from itmo_video.presets import make_settings
from itmo_video.settings import Settings
from itmo_video.source.opening import input_files
from itmo_video.source.pipe import is_pipe
from itmo_video.words import counted

STILLS = (".avif", ".png", ".jpg", ".jpeg")


@dataclass(frozen=True)
class PreviewSummary:
    """What a preview is: frames, seconds it took, and the film's MaxCLL and MaxFALL in nits.

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
    settings: Settings | None = None,
    run: RunOptions | None = None,
    options: PreviewOptions | None = None,
    on_event: OnEvent = ignore,
) -> PreviewSummary:
    """Make a film or a still of a clip, converted on the fly, or of a converted folder.

    A folder is shown as it is and its source is read as it was then; UsageError for `settings`.
    Raises the errors of itmo_video.errors, DamagedInputError only after all that decodes was
    written; OutputError before any work where `output` may not be written over (output.gate).
    `on_event` is told Warned, Started, FrameDone and Finished.

    >>> from itmo_video import PreviewOptions, preview
    >>> preview("clip.mkv", "frame.jpg", options=PreviewOptions(frame=2)).frames
    1
    """
    options, run = options or PreviewOptions(), run or RunOptions()
    source, output = Path(source), Path(output)
    is_jpeg = output.suffix.lower() in (".jpg", ".jpeg")
    options = replace(options, view=options.view or ("sdr" if is_jpeg else "hdr10"))
    began = time.monotonic()
    _check(output, options)
    if options.frame is not None:
        run = replace(run, frames=str(options.frame))
    gate = None if is_stream_output(output) else _gate(source, output, options, run)
    if gate is not None:
        gate.check()
    if source.is_dir():
        if settings is not None or run.analysis is not None:
            raise UsageError(
                "a converted folder is shown as it was made, whatever settings are given",
                where=str(source),
                remedy="Leave the settings and --analysis out, or give the clip itself.",
            )
        clip = options.clip if options.view == "compare" else None
        pictures = from_folder(open_converted(source), clip, run)
        pictures.clip = options.clip
    else:
        pictures = from_clip(source, settings or make_settings(), run)
    if options.view == "compare" and source.is_dir() and options.clip is None:
        raise UsageError("compare needs the source", remedy="Say where it is: --source CLIP.")
    for notice in pictures.notices:
        on_event(Warned(notice))
    on_event(Started(str(source), str(output), len(pictures.numbers), 0))
    if options.frame is not None:
        assert gate is not None
        frames, light, size = 1, *_still(pictures, gate, options)
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
    if pictures.damage:
        raise DamagedInputError(
            "; ".join(pictures.damage),
            where=str(source),
            remedy=f"{counted(frames, 'frame')} shown.",
        )
    return summary


def _check(output: Path, options: PreviewOptions) -> None:
    suffix = output.suffix.lower()
    if (options.frame is not None) != (suffix in STILLS):
        raise UsageError(
            f"{output.name}: --frame N makes a still, without it a film is made",
            remedy=f"Stills are named {', '.join(STILLS)}; films .mp4, .mov, .mkv, .y4m or -.",
        )
    if options.frame is None:
        check_film_options(output, options)
    is_hdr = options.view in ("hdr10", "hlg")
    if suffix == ".avif" and options.view != "hdr10":
        raise UsageError("AVIF stills are PQ", remedy="Take --as hdr10, or name it .png or .jpg.")
    if suffix in STILLS and options.view == "hlg":
        raise UsageError("stills are PQ or SDR, not HLG", remedy="Take --as hdr10 or sdr.")
    if suffix in (".jpg", ".jpeg") and is_hdr:
        raise UsageError("JPEG cannot hold HDR", remedy="Take --as sdr, compare, false-colour, ...")


def _gate(source: Path, output: Path, options: PreviewOptions, run: RunOptions) -> Gate:
    manifest = read_manifest(source) if source.is_dir() else None
    inputs = [] if is_pipe(source) else input_files(source)
    inputs += input_files(options.clip) if options.clip else []
    return Gate(
        output,
        FILM if options.frame is None else STILL,
        inputs=inputs,
        overwrite=run.overwrite,
        source_digest=manifest.source_digest if manifest else None,
    )


def _still(pictures: Pictures, gate: Gate, options: PreviewOptions) -> tuple[Light, int]:
    suffix = gate.path.suffix.lower()

    def make(picture: Picture) -> tuple[bytes, Light]:
        if signal_of(options) == "sdr":
            view = sdr_view(picture, pictures, options)
            return stills.sdr_still(view, suffix), Light(0.0, 0.0)
        rgb, primaries, white = light_of(picture, pictures, options)
        if suffix == ".png":
            nits = hdr.to_nits_2020(rgb, primaries, white, pictures.peak_nits)
            code, light = hdr.encode_nits(nits, "pq", pictures.peak_nits), hdr.frame_light(nits)
            mastering = Mastering(CHROMATICITIES["p3d65"], pictures.peak_nits)
            return stills.png_pq(code, mastering, light), light
        planes, light = hdr.master_frame(
            rgb, primaries, white, pictures.peak_nits, "pq", "420", picture.index
        )
        crf = crf_of(options)
        return encode.encode_avif(planes, crf if crf is not None else 12), light

    made = next(pictures.mapped(make), None)
    if made is None:
        raise DamagedInputError(f"frame {options.frame} does not decode")
    return made[1], gate.write(made[0])
