"""The edge of delivery: a clip or a converted folder to a film or a still to look at.

A film costs one rendering: workers render, measure and convert to codes, the calling thread encodes
them in order, and MaxCLL and MaxFALL are completed in the finished file.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from math import gcd
from pathlib import Path
from typing import Any

import numpy as np

from itmo_video.colour.primaries import CHROMATICITIES
from itmo_video.conversion.run_options import RunOptions
from itmo_video.delivery import encode, hdr, sdr, stills
from itmo_video.delivery.encode import HIGH_CRF, FilmSpec, FilmWriter, YCbCr
from itmo_video.delivery.from_clip import from_clip
from itmo_video.delivery.from_folder import from_folder
from itmo_video.delivery.hdr import Chroma, Light
from itmo_video.delivery.metadata import Mastering
from itmo_video.delivery.pictures import Picture, Pictures
from itmo_video.delivery.preview_options import PreviewOptions
from itmo_video.errors import DamagedInputError, UsageError
from itmo_video.events import Finished, FrameDone, OnEvent, Started, Warned, ignore
from itmo_video.output.converted import open_converted
from itmo_video.output.folder import read_manifest
from itmo_video.output.gate import FILM, STILL, Gate
from itmo_video.presets import make_settings
from itmo_video.settings import Settings
from itmo_video.source.opening import input_files, is_film
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


@dataclass(frozen=True)
class _Shot:
    """One frame ready for the encoder."""

    time_s: Fraction
    planes: YCbCr
    light: Light


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
    gate = _gate(source, output, options, run)
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
    if options.view == "compare" and pictures.clip is None:
        raise UsageError("compare needs the source", remedy="Say where it is: --source CLIP.")
    for notice in pictures.notices:
        on_event(Warned(notice))
    on_event(Started(str(source), str(output), len(pictures.numbers), 0))
    if options.frame is not None:
        frames, light = 1, _still(pictures, gate, options)
    else:
        frames, light = _film(pictures, gate, options, run, on_event)
    summary = PreviewSummary(
        frames, time.monotonic() - began, output.stat().st_size, light.peak, light.average
    )
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
            remedy=f"Stills are named {', '.join(STILLS)}; films .mp4, .mov, .mkv.",
        )
    is_hdr = options.view in ("hdr10", "hlg")
    if suffix == ".avif" and options.view != "hdr10":
        raise UsageError("AVIF stills are PQ", remedy="Take --as hdr10, or name it .png or .jpg.")
    if suffix in STILLS and options.view == "hlg":
        raise UsageError("stills are PQ or SDR, not HLG", remedy="Take --as hdr10 or sdr.")
    if suffix in (".jpg", ".jpeg") and is_hdr:
        raise UsageError("JPEG cannot hold HDR", remedy="Take --as sdr, compare, false-colour, ...")


def _crf(options: PreviewOptions) -> float | None:
    # ProRes is of high quality without being asked.
    return HIGH_CRF.get(options.codec) if options.crf == "high" else options.crf


def _gate(source: Path, output: Path, options: PreviewOptions, run: RunOptions) -> Gate:
    manifest = read_manifest(source) if source.is_dir() else None
    inputs = input_files(source) + (input_files(options.clip) if options.clip else [])
    return Gate(
        output,
        FILM if options.frame is None else STILL,
        inputs=inputs,
        overwrite=run.overwrite,
        source_digest=manifest.source_digest if manifest else None,
    )


def _signal(options: PreviewOptions) -> encode.Signal:
    if options.view == "hdr10" or (options.view == "compare" and options.hdr_compare):
        return "pq"
    return "hlg" if options.view == "hlg" else "sdr"


def _light_of(
    picture: Picture, pictures: Pictures, options: PreviewOptions
) -> tuple[Sequence[Any], str, float]:
    """Linear planes, their primaries and the nits of 1.0; compare has the source beside."""
    white = pictures.white_nits
    if options.view != "compare":
        return picture.rgb, pictures.primaries, white
    assert picture.source is not None
    source = sdr.source_picture(picture.source)
    result = sdr.to_709(picture.rgb, pictures.primaries)
    both = sdr.composed(source, result, options.layout, options.wipe_at)
    return [np.ascontiguousarray(both[..., i]) for i in range(3)], "rec709", white


def sdr_view(picture: Picture, pictures: Pictures, options: PreviewOptions) -> sdr.Picture:
    """R'G'B' of a frame (H, W, 3) in [0, 1] for the views sdr, compare, false-colour and ladder."""
    linear = sdr.to_709(picture.rgb, pictures.primaries)
    peak = pictures.peak_nits / pictures.white_nits
    if options.view == "false-colour":
        return sdr.false_colour(linear, options.scale, pictures.white_nits, peak)
    if options.view == "ladder":
        return sdr.ladder(linear, peak)
    result = sdr.tone_mapped(linear, options.tone_map, peak)
    if options.view == "sdr":
        return result
    assert picture.source is not None
    source = sdr.encoded(sdr.source_picture(picture.source))
    return sdr.composed(source, result, options.layout, options.wipe_at)


def _shot(picture: Picture, pictures: Pictures, options: PreviewOptions, chroma: Chroma) -> _Shot:
    signal = _signal(options)
    if signal == "sdr":
        view = sdr_view(picture, pictures, options)
        code: Any = tuple(np.ascontiguousarray(view[..., i]) for i in range(3))
        even: Any = hdr.pad_even(code)
        planes = hdr.to_ycbcr10(even, "bt709", chroma, picture.index)
        return _Shot(picture.time_s, planes, Light(0.0, 0.0))
    rgb, primaries, white = _light_of(picture, pictures, options)
    curve: hdr.Curve = "pq" if signal == "pq" else "hlg"
    planes, light = hdr.master_frame(
        rgb, primaries, white, pictures.peak_nits, curve, chroma, picture.index
    )
    return _Shot(picture.time_s, planes, light)


def _film(
    pictures: Pictures,
    gate: Gate,
    options: PreviewOptions,
    run: RunOptions,
    on_event: OnEvent,
) -> tuple[int, Light]:
    chroma = options.chroma or encode.default_chroma(options.codec)
    spec = FilmSpec(
        2, 2, pictures.frame_rate, _time_base(pictures), pictures.pixel_aspect, _signal(options),
        options.codec, chroma, pictures.peak_nits, _crf(options), options.speed,
    )  # fmt: skip
    encode.check_film(gate.path, spec)
    shots = pictures.mapped(lambda picture: _shot(picture, pictures, options, chroma))
    lights: list[Light] = []
    try:
        first = next(shots, None)
        if first is None:
            raise DamagedInputError("no frame could be made", where=str(pictures.clip))
        height, width = first.planes[0].shape
        spec = replace(spec, width=width, height=height)
        film = pictures.clip if pictures.clip and is_film(pictures.clip) else None
        sound = None if options.no_audio else film
        is_whole = run.frames is None
        with FilmWriter(
            gate, spec, sound, first.time_s, is_whole=is_whole, stream=pictures.stream
        ) as writer:
            for notice in writer.notices:
                on_event(Warned(notice))
            for shot, length in _with_durations(first, shots):
                writer.write(shot.planes, shot.time_s, length)
                lights.append(shot.light)
                number = pictures.numbers[len(lights) - 1]
                on_event(FrameDone(number, len(lights), len(pictures.numbers)))
            light = hdr.film_light(lights)
            writer.finish(light)
    finally:
        shots.close()  # type: ignore[attr-defined]  # whoever maps, it is a generator
    return len(lights), light


def _with_durations(
    first: _Shot, others: Iterator[_Shot]
) -> Iterator[tuple[_Shot, Fraction | None]]:
    """Each shot with the time until the next; None for the last."""
    shot = first
    for following in others:
        yield shot, following.time_s - shot.time_s
        shot = following
    yield shot, None


def _time_base(pictures: Pictures) -> Fraction:
    """The source's unit of time where it is known, so that its stamps stay exact."""
    if pictures.clip is not None and is_film(pictures.clip):
        return encode.source_time_base(pictures.clip, pictures.stream)
    rate = pictures.frame_rate.numerator
    common = rate * 90000 // gcd(rate, 90000)
    return Fraction(1, common if common < 2**31 else 90000)


def _still(pictures: Pictures, gate: Gate, options: PreviewOptions) -> Light:
    suffix = gate.path.suffix.lower()

    def make(picture: Picture) -> tuple[bytes, Light]:
        if _signal(options) == "sdr":
            view = sdr_view(picture, pictures, options)
            return stills.sdr_still(view, suffix), Light(0.0, 0.0)
        rgb, primaries, white = _light_of(picture, pictures, options)
        if suffix == ".png":
            nits = hdr.to_nits_2020(rgb, primaries, white, pictures.peak_nits)
            code, light = hdr.encode_nits(nits, "pq", pictures.peak_nits), hdr.frame_light(nits)
            mastering = Mastering(CHROMATICITIES["p3d65"], pictures.peak_nits)
            return stills.png_pq(code, mastering, light), light
        planes, light = hdr.master_frame(
            rgb, primaries, white, pictures.peak_nits, "pq", "420", picture.index
        )
        crf = _crf(options)
        return encode.encode_avif(planes, crf if crf is not None else 12), light

    made = next(pictures.mapped(make), None)
    if made is None:
        raise DamagedInputError(f"frame {options.frame} does not decode")
    gate.write(made[0])
    return made[1]
