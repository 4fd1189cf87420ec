"""Encoding by PyAV: films with sound and chapters of their source, and AVIF stills.

The only module of delivery that imports av.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any, Literal

import av
import numpy as np

from itmo_video.colour import primaries
from itmo_video.delivery import metadata
from itmo_video.delivery.hdr import Chroma, Codes10, Light
from itmo_video.delivery.sound import Sound
from itmo_video.errors import ItmoError, OutputError, UsageError
from itmo_video.output.atomic import temp_path
from itmo_video.output.gate import Gate
from itmo_video.source.packets import TAG_ERRORS, open_video

Codec = Literal["av1", "hevc", "prores"]
Signal = Literal["pq", "hlg", "sdr"]
YCbCr = tuple[Codes10, Codes10, Codes10]
_MAX_PIXELS = 2**27  # of a source that only its sound and its stamps are read of

_ENCODERS: dict[str, str] = {"av1": "libsvtav1", "hevc": "libx265", "prores": "prores_ks"}
_MUXERS = {".mp4": "mp4", ".m4v": "mp4", ".mov": "mov", ".mkv": "matroska"}
# Code points of ITU-T H.273: primaries, transfer, matrix.
_CODE_POINTS: dict[str, tuple[int, int, int]] = {
    "pq": (9, 16, 9),
    "hlg": (9, 18, 9),
    "sdr": (1, 1, 1),
}
DEFAULT_CRF: dict[str, int] = {"av1": 25, "hevc": 18}
HIGH_CRF: dict[str, float] = {"av1": 1, "hevc": 1}  # nits within 2 % in the median, dark ones too
DEFAULT_SPEED: dict[str, str] = {"av1": "5", "hevc": "fast"}


@dataclass(frozen=True)
class FilmSpec:
    """What a film is encoded as: sizes in pixels (even), times in seconds, light in nits."""

    width: int
    height: int
    frame_rate: Fraction
    time_base: Fraction
    pixel_aspect: Fraction
    signal: Signal
    codec: Codec = "av1"
    chroma: Chroma = "420"
    peak_nits: float = 1000.0
    crf: float | None = None
    speed: str | None = None

    @property
    def mastering(self) -> metadata.Mastering:
        """A P3 display with the stated peak, on which HDR10 is mastered by custom."""
        return metadata.Mastering(primaries.CHROMATICITIES["p3d65"], self.peak_nits)


def default_chroma(codec: Codec) -> Chroma:
    """4:2:2 for ProRes 422 HQ, 4:2:0 for what is distributed."""
    return "422" if codec == "prores" else "420"


def source_time_base(path: Path, number: int | None = None) -> Fraction:
    """The unit that a film's video time stamps are counted in, in seconds; raises InputError."""
    with open_video(path, _MAX_PIXELS, number) as (_, stream):
        return Fraction(stream.time_base or Fraction(1, 90000))


def check_film(path: Path, spec: FilmSpec) -> None:
    """Raise UsageError for a combination that no player or encoder takes."""
    if path.suffix.lower() not in _MUXERS:
        raise UsageError(f"{path.name}: cannot be a film", remedy=f"Name it {', '.join(_MUXERS)}.")
    if spec.codec == "av1" and path.suffix.lower() == ".mov":
        raise UsageError("AV1 does not go into .mov", remedy="Name the output .mp4 or .mkv.")
    if spec.codec == "prores" and path.suffix.lower() not in (".mov", ".mkv"):
        raise UsageError("ProRes goes into .mov or .mkv", remedy="Name the output film.mov.")
    if spec.codec == "prores" and spec.crf is not None:
        raise UsageError("ProRes 422 HQ has a fixed quality", remedy="Leave --crf out.")
    if spec.pixel_aspect != 1 and spec.codec == "av1" and path.suffix.lower() == ".mkv":
        raise UsageError(  # AV1's own header has none, and PyAV does not set Matroska's
            "AV1 in .mkv would lose the shape of its pixels", remedy="Name the output .mp4."
        )
    if spec.codec == "av1" and spec.chroma == "422":
        raise UsageError("SVT-AV1 encodes 4:2:0 only", remedy="Take --codec hevc or prores.")
    if spec.codec == "prores" and spec.chroma == "420":
        raise UsageError("ProRes 422 is 4:2:2", remedy="Leave --chroma out.")


class FilmWriter:
    """Writes a film under a temporary name; `finish` completes it and puts it through its gate.

    In `with`, a film that is not finished is removed. Sound and chapters are copied from `source`
    as they are; InputError where it is no regular file in a known container. `first_s` is the first
    frame's time in the source. A whole film begins at 0, whenever its source does; of a part, sound
    before it and after the last frame is left out. `notices` says what is not copied.
    """

    def __init__(
        self,
        gate: Gate,
        spec: FilmSpec,
        source: Path | None = None,
        first_s: Fraction = Fraction(0),
        *,
        is_whole: bool = True,
        stream: int | None = None,
    ) -> None:
        path = gate.path
        check_film(path, spec)
        self._gate, self.path, self.spec = gate, path, spec
        self._is_whole = is_whole
        self._start_s = first_s
        self.notices: list[str] = []
        self._temp = temp_path(path.absolute())
        self._last_pts: int | None = None
        self._end_s: Fraction | None = None
        muxer = _MUXERS[path.suffix.lower()]
        # A check sum of Matroska's would not know of the completed metadata.
        options = {"write_crc32": "0"} if muxer == "matroska" else {}
        options["fflags"] = "+bitexact"  # else Matroska's identifiers are drawn by chance
        self._source: Sound | None = None
        try:
            self._box: Any = av.open(
                os.fspath(self._temp), "w", format=muxer, options=options, **TAG_ERRORS
            )
            self._stream = self._add_video()
            self._sound: Iterator[tuple[Any, Fraction]] = iter(())
            self._waiting: tuple[Any, Fraction] | None = None
            if source is not None:
                self._source = Sound(source, self._box, stream)
                self._add_sound(self._source)
        except ItmoError:
            self.close()
            raise
        except (av.FFmpegError, OSError, ValueError) as error:
            self.close()
            raise _failure(error, path) from error

    def __enter__(self) -> FilmWriter:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def write(self, planes: YCbCr, time_s: Fraction, duration_s: Fraction | None = None) -> None:
        """Encode one frame, to be shown from `time_s` on; frames come in rising time."""
        spec = self.spec
        frame = _frame(planes, "yuv422p10le" if spec.chroma == "422" else "yuv420p10le")
        frame.pts = round((time_s - self._start_s) / spec.time_base)
        if self._last_pts is not None and frame.pts <= self._last_pts:
            frame.pts = self._last_pts + 1
        self._last_pts = frame.pts
        frame.time_base = spec.time_base
        length = duration_s if duration_s is not None else 1 / spec.frame_rate
        frame.duration = max(1, round(length / spec.time_base))
        self._end_s = time_s + length
        _tag(frame, spec.signal)
        try:
            self._mux(self._stream.encode(frame))
        except (av.FFmpegError, OSError, ValueError) as error:
            raise _failure(error, self.path) from error

    def finish(self, light: Light | None) -> None:
        """Flush, copy the rest of the sound, complete MaxCLL and MaxFALL and rename the file."""
        try:
            self._mux(self._stream.encode(None))
            self._mux_sound(None if self._is_whole else self._end_s)
            self._box.close()
            if light is not None and self.spec.signal == "pq":
                found = metadata.complete_light(self._temp, self.spec.codec, light)
                if self.spec.codec != "prores" and not found:
                    raise OutputError("its encoder wrote no content light", where=str(self.path))
                if self.path.suffix.lower() != ".mkv":
                    metadata.add_boxes(self._temp, self.spec.mastering, light)
            self._gate.put(self._temp)
        except (av.FFmpegError, OSError, ValueError) as error:
            raise _failure(error, self.path) from error

    def close(self) -> None:
        """Close everything and remove what was not finished."""
        for thing in (getattr(self, "_box", None), self._source):
            with suppress(Exception):
                if thing is not None:
                    thing.close()
        with suppress(OSError):
            self._temp.unlink()

    def _add_video(self) -> Any:
        spec = self.spec
        stream: Any = self._box.add_stream(
            _ENCODERS[spec.codec], rate=spec.frame_rate, options=_options(spec)
        )
        stream.width, stream.height = spec.width, spec.height
        stream.pix_fmt = "yuv422p10le" if spec.chroma == "422" else "yuv420p10le"
        context = stream.codec_context
        context.time_base = spec.time_base
        stream.time_base = spec.time_base
        context.sample_aspect_ratio = spec.pixel_aspect
        context.gop_size = max(1, round(2 * spec.frame_rate))  # so that players can seek
        if spec.codec == "hevc":
            context.codec_tag = "hvc1"  # Apple's players take no other
        _tag(context, spec.signal)
        with _svt_in_silence():
            context.open()
        return stream

    def _add_sound(self, source: Sound) -> None:
        self.notices += source.notices
        chapters = source.chapters()
        if chapters and self._is_whole:
            self._box.set_chapters(chapters)
        if self._is_whole:
            # Captures begin at any time; sound that is primed before 0 stays as it is.
            self._start_s = max(Fraction(0), min(self._start_s, source.first_s))
        self._sound = source.packets()

    def _mux(self, packets: list[Any]) -> None:
        for packet in packets:
            if packet.pts is not None:
                self._mux_sound(packet.pts * Fraction(packet.time_base) + self._start_s)
            self._box.mux(packet)

    def _mux_sound(self, until_s: Fraction | None) -> None:
        """Copy the sound's packets that begin before `until_s` (source time)."""
        while True:
            found = self._waiting if self._waiting is not None else next(self._sound, None)
            if found is None:
                return
            self._waiting = None
            packet, at = found
            base = Fraction(packet.time_base)
            if until_s is not None and at >= until_s:
                self._waiting = found
                return
            # A codec's priming before 0 belongs to the sound of a whole film.
            if not self._is_whole and at + (packet.duration or 0) * base <= self._start_s:
                continue
            shift = round(self._start_s / base)
            packet.pts -= shift
            if packet.dts is not None:
                packet.dts -= shift
            self._box.mux(packet)


def encode_avif(planes: YCbCr, crf: float) -> bytes:
    """A 10-bit PQ BT.2020 AVIF still, 4:2:0, of the encoder that films use."""
    import io

    target = io.BytesIO()
    height, width = planes[0].shape
    with av.open(target, "w", format="avif") as box:
        stream: Any = box.add_stream(
            "libsvtav1",
            rate=Fraction(1),
            options={"crf": f"{crf:g}", "preset": DEFAULT_SPEED["av1"]},
        )
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p10le"
        _tag(stream.codec_context, "pq")
        with _svt_in_silence():
            stream.codec_context.open()
        frame = _frame(planes, "yuv420p10le")
        frame.pts = 0
        _tag(frame, "pq")
        box.mux(stream.encode(frame))
        box.mux(stream.encode(None))
    return target.getvalue()


_environment_lock = threading.Lock()


@contextmanager
def _svt_in_silence() -> Iterator[None]:
    """SVT-AV1 asks the environment, when it starts, whether it may write to standard error."""
    name = "SVT_LOG"
    with _environment_lock:
        if name in os.environ:
            yield
            return
        os.environ[name] = "0"
        try:
            yield
        finally:
            del os.environ[name]


def _options(spec: FilmSpec) -> dict[str, str]:
    if spec.codec == "prores":
        return {"profile": "3", "vendor": "apl0"}
    crf = spec.crf if spec.crf is not None else DEFAULT_CRF[spec.codec]
    options = {"crf": f"{crf:g}", "preset": spec.speed or DEFAULT_SPEED[spec.codec]}
    cll, fall = metadata.PLACEHOLDER
    is_hdr10 = spec.signal == "pq"
    if spec.codec == "av1":
        if is_hdr10:
            options["svtav1-params"] = (
                f"mastering-display={spec.mastering.for_svt()}:content-light={cll},{fall}"
            )
        return options
    # Its own SEI lists its options, among them the placeholders below.
    told = ["log-level=none", "info=0", "repeat-headers=1", "chromaloc=0"]
    if is_hdr10:
        told += ["hdr10=1", f"master-display={spec.mastering.for_x265()}", f"max-cll={cll},{fall}"]
    return options | {"x265-params": ":".join(told)}


def _tag(thing: Any, signal: Signal) -> None:
    thing.color_primaries, thing.color_trc, thing.colorspace = _CODE_POINTS[signal]
    thing.color_range = 1


def _frame(planes: YCbCr, pixel_format: str) -> Any:
    height, width = planes[0].shape
    frame = av.VideoFrame(width, height, pixel_format)
    for codes, plane in zip(planes, frame.planes, strict=True):
        rows = np.frombuffer(memoryview(plane), np.uint16).reshape(plane.height, -1)
        rows[:, : plane.width] = codes
    return frame


def _failure(error: Exception, path: Path) -> OutputError:
    reason = getattr(error, "strerror", None) or str(error)
    return OutputError(
        f"cannot be encoded: {reason}",
        where=str(path),
        remedy="Where it is the sound that does not fit the container, .mkv takes all kinds.",
    )
