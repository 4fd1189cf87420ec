"""Writing a preview's frames as a film, to a file or a pipe."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from fractions import Fraction
from math import gcd
from pathlib import Path

from itmo_video.conversion.run_options import RunOptions
from itmo_video.delivery import hdr
from itmo_video.delivery.film_spec import (
    HIGH_CRF,
    KEEPS_ALPHA,
    MASTERS,
    FilmSpec,
    check_film,
    check_speed,
    default_chroma,
)
from itmo_video.delivery.film_writer import FilmWriter
from itmo_video.delivery.hdr import Light
from itmo_video.delivery.hdr10plus import checked_length, read_hdr10plus
from itmo_video.delivery.pictures import Pictures
from itmo_video.delivery.preview_options import PreviewOptions
from itmo_video.delivery.sound import source_time_base
from itmo_video.delivery.views import (
    WITHOUT_ALPHA,
    ShownFrame,
    frame_with_alpha,
    shown_peak,
    signal_of,
)
from itmo_video.delivery.y4m import ReaderLeftError, Y4mSpec, Y4mWriter
from itmo_video.errors import DamagedInputError, UsageError
from itmo_video.events import FrameDone, OnEvent, Warned
from itmo_video.output.gate import Gate
from itmo_video.source.opening import is_film
from itmo_video.source.pipe import is_pipe
from itmo_video.words import counted

Y4M_SUFFIX = ".y4m"
OVER_BLACK = "alpha is not written: transparent pixels are over black"
_NO_LIGHT = Light(0.0, 0.0)
_UNEVEN = 0.25  # of a frame's time; stamps in milliseconds are off by less, up to 120 fps
_ONE_RATE = (
    "Y4M has one frame rate: the times of these frames, which differ, are lost; use --fps N "
    "with a file, or write a film"
)


def is_y4m(output: Path) -> bool:
    """Whether a film is written as Y4M: to standard output, a FIFO, or by its name."""
    return output.suffix.lower() == Y4M_SUFFIX or is_pipe(output)


def write_film(
    pictures: Pictures,
    output: Path,
    gate: Gate | None,
    options: PreviewOptions,
    run: RunOptions,
    on_event: OnEvent,
) -> tuple[int, Light, int]:
    """Write the pictures as a film; returns the count, the light levels and the bytes written.

    `gate` is None for a pipe. A reader that closes its pipe ends the film there.
    """
    chroma = options.chroma or default_chroma(options.codec)
    spec = FilmSpec(
        2, 2, pictures.frame_rate, _time_base(pictures, run), pictures.pixel_aspect,
        signal_of(options), options.codec, chroma, shown_peak(pictures, options), crf_of(options),
        options.speed,
    )  # fmt: skip
    if not is_y4m(output):
        check_film(output, spec)
    messages = _messages(pictures, options)
    keeps_alpha = options.codec == KEEPS_ALPHA and not is_y4m(output)
    shown = pictures.mapped(
        lambda picture: frame_with_alpha(picture, pictures, options, chroma, keeps_alpha)
    )
    count, light = 0, _NO_LIGHT
    is_uneven = False
    before_s: Fraction | None = None
    try:
        first = next(shown, None)
        if first is None:
            raise DamagedInputError("no frame could be rendered", where=str(pictures.clip))
        height, width = first.planes[0].shape
        spec = replace(spec, width=width, height=height, has_alpha=first.alpha is not None)
        with closing(_writer(output, gate, spec, options, pictures, run, first.time_s)) as writer:
            for notice in writer.notices:
                on_event(Warned(notice))
            for notice in _changes(pictures, spec, first, options):
                on_event(Warned(notice))
            try:
                for frame, length in _with_durations(first, shown, pictures.last_length_s):
                    is_uneven = is_uneven or _is_uneven(before_s, frame.time_s, spec.frame_rate)
                    before_s = frame.time_s
                    planes = frame.planes if frame.alpha is None else (*frame.planes, frame.alpha)
                    writer.write(planes, frame.time_s, length, messages.get(frame.number))
                    count, light = count + 1, hdr.film_light((light, frame.light))
                    on_event(FrameDone(frame.number, count, len(pictures.numbers)))
                writer.finish(light)
            except ReaderLeftError:
                on_event(Warned(f"the reader closed the pipe after {counted(count, 'frame')}"))
            if is_uneven and is_y4m(output):
                on_event(Warned(_ONE_RATE))
    finally:
        shown.close()  # type: ignore[attr-defined]  # whoever maps, it is a generator
    size = writer.bytes_written if isinstance(writer, Y4mWriter) else output.stat().st_size
    return count, light, size


def _is_uneven(before_s: Fraction | None, time_s: Fraction, frame_rate: Fraction) -> bool:
    """Whether a frame does not follow the one before by about a frame's time."""
    return before_s is not None and abs((time_s - before_s) * frame_rate - 1) > _UNEVEN


def _changes(
    pictures: Pictures, spec: FilmSpec, first: ShownFrame, options: PreviewOptions
) -> Iterator[str]:
    """What of the pictures the film does not keep: alpha, odd sizes."""
    if first.had_alpha and first.alpha is None:
        could = spec.codec in MASTERS and options.view not in WITHOUT_ALPHA
        yield OVER_BLACK + ("; --codec prores4444 keeps it (.mov)" if could else "")
    width, height = pictures.size
    if spec.height - height == height % 2 == 1 or spec.width - width == width % 2 == 1:
        yield (
            f"the film is {spec.width}x{spec.height}, the picture {width}x{height}: the last "
            "column or row is repeated, as films have even sizes"
        )


def _writer(
    output: Path,
    gate: Gate | None,
    spec: FilmSpec,
    options: PreviewOptions,
    pictures: Pictures,
    run: RunOptions,
    first_s: Fraction,
) -> FilmWriter | Y4mWriter:
    if is_y4m(output):
        stream = Y4mSpec(
            spec.width, spec.height, spec.frame_rate, spec.pixel_aspect, spec.chroma,
            int(options.depth),
        )  # fmt: skip
        return Y4mWriter(output, stream, gate)
    assert gate is not None
    film = pictures.clip if pictures.clip and is_film(pictures.clip) else None
    return FilmWriter(
        gate, spec, None if options.no_audio else film, first_s, is_whole=run.frames is None,
        stream=pictures.stream, max_pixels=run.max_pixels,
    )  # fmt: skip


def _messages(pictures: Pictures, options: PreviewOptions) -> dict[int, bytes]:
    """HDR10+ of each frame by its number, where a file of it is given."""
    if options.hdr10plus is None:
        return {}
    if not pictures.numbers:
        raise UsageError(
            "a pipe does not say how many frames HDR10+ metadata must be for",
            remedy="Give the clip as a file.",
        )
    messages = read_hdr10plus(options.hdr10plus)
    checked_length(messages, len(pictures.numbers), options.hdr10plus)
    return dict(zip(pictures.numbers, messages, strict=True))


def crf_of(options: PreviewOptions) -> float | None:
    """The CRF that `high` stands for, or the one given."""
    # ProRes always has high quality.
    return HIGH_CRF.get(options.codec) if options.crf == "high" else options.crf


def check_film_options(output: Path, options: PreviewOptions) -> None:
    """Raise UsageError for options that do not apply to this kind of film."""
    if options.hdr10plus is not None:
        if options.view != "hdr10" or options.display_peak is not None:
            raise UsageError(
                "HDR10+ metadata is of the HDR10 film as it was analysed",
                remedy="Omit --hdr10plus, or take --as hdr10 without --display-peak.",
            )
        if is_y4m(output) or options.codec not in ("av1", "hevc"):
            raise UsageError(
                "HDR10+ metadata goes into AV1 and HEVC streams only",
                remedy="Omit --hdr10plus, or take --codec hevc.",
            )
    if not is_y4m(output):
        if options.depth != "10":
            raise UsageError("films have 10 bits", remedy="8 bits are for .y4m only.")
        check_speed(options.codec, options.speed)
        return
    if options.crf is not None or options.speed is not None:
        raise UsageError("Y4M is not compressed", remedy="Set --crf and --speed in the encoder.")
    if options.depth == "8" and signal_of(options) != "sdr":
        raise UsageError("HDR needs 10 bits", remedy="8 bits are for SDR views, such as --as sdr.")


def _with_durations(
    first: ShownFrame, others: Iterator[ShownFrame], last_length_s: Fraction | None
) -> Iterator[tuple[ShownFrame, Fraction | None]]:
    """Each frame with the time until the next; `last_length_s` for the last."""
    frame = first
    for following in others:
        yield frame, following.time_s - frame.time_s
        frame = following
    yield frame, last_length_s


def _time_base(pictures: Pictures, run: RunOptions) -> Fraction:
    """The source's time base, if known, so that its time stamps stay exact."""
    if pictures.clip is not None and is_film(pictures.clip):
        return source_time_base(pictures.clip, run.max_pixels, pictures.stream)
    rate = pictures.frame_rate.numerator
    common = rate * 90000 // gcd(rate, 90000)
    return Fraction(1, common if common < 2**31 else 90000)
