"""Writing a film with PyAV, with the sound and chapters of its source."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from typing import Any

import av

from itmo_video.delivery import metadata
from itmo_video.delivery.encoders import (
    ENCODERS,
    encoder_options,
    frame_of,
    tag_signal,
)
from itmo_video.delivery.film_spec import (
    MASTERS,
    MUXERS,
    FilmSpec,
    check_film,
    check_size,
    pixel_format,
)
from itmo_video.delivery.hdr import Light
from itmo_video.delivery.log_curves import TOLD
from itmo_video.delivery.messages import with_message
from itmo_video.delivery.sound import Sound
from itmo_video.delivery.svt_av1 import svt_as_guest
from itmo_video.delivery.ycbcr import Codes10
from itmo_video.errors import ItmoError, OutputError
from itmo_video.memory_limit import check_memory
from itmo_video.output.atomic import NO_SPACE, RUN_AGAIN, output_error, temp_path
from itmo_video.output.gate import Gate
from itmo_video.source.files import MAX_PIXELS
from itmo_video.source.packets import TAG_ERRORS

# With fewer frames than it may reorder, x265 (4.1) reads an uninitialised decoding time; so few
# are not reordered.
_X265_REORDERS = 2


class FilmWriter:
    """Writes a film under a temporary name; `finish` completes and renames it.

    `close` removes an unfinished film (contextlib.closing). Sound and chapters are copied unchanged
    from `source`; InputError unless it is a regular file in a known container. `first_s` is the
    first frame's time in the source. A whole film starts at 0, wherever its source does; for a
    range of frames, sound before and after it is omitted. `notices` lists what is not copied.
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
        max_pixels: int = MAX_PIXELS,
    ) -> None:
        path = gate.path
        check_film(path, spec)
        check_size(spec.codec, spec.width, spec.height)
        self._gate, self.path, self.spec = gate, path, spec
        self._is_whole = is_whole
        self._start_s = first_s
        self.notices: list[str] = []
        self._temp = temp_path(path.absolute())
        self._last_pts: int | None = None
        self._frames = 0
        self._lengths: dict[int, int] = {}
        self._messages: dict[int, bytes] = {}
        self._end_s: Fraction | None = None
        muxer = MUXERS[path.suffix.lower()]
        # Matroska's checksum would not match the completed metadata.
        options = {"write_crc32": "0"} if muxer == "matroska" else {}
        options["fflags"] = "+bitexact"  # otherwise Matroska's identifiers are random
        self._source: Sound | None = None
        try:
            self._box: Any = av.open(
                os.fspath(self._temp), "w", format=muxer, options=options, **TAG_ERRORS
            )
            if spec.signal in TOLD:
                self._box.metadata["comment"] = TOLD[spec.signal]
            self._stream = self._add_video()
            self._sound: Iterator[tuple[Any, Fraction]] = iter(())
            self._waiting: tuple[Any, Fraction] | None = None
            if source is not None:
                self._source = Sound(source, self._box, max_pixels, stream)
                self._add_sound(self._source)
        except ItmoError:
            self.close()
            raise
        except (av.FFmpegError, OSError, ValueError) as error:
            self.close()
            raise _failure(error, path, self._source is not None) from error

    def write(
        self,
        planes: tuple[Codes10, ...],
        time_s: Fraction,
        duration_s: Fraction | None = None,
        message: bytes | None = None,
    ) -> None:
        """Encode one frame, to be shown from `time_s` on; frames come in rising time.

        `planes` are Y', Cb, Cr and, where the film has it, alpha. `message` is of ITU-T T.35 and
        goes with the frame (HEVC and AV1).
        """
        spec = self.spec
        frame = frame_of(planes, pixel_format(spec.chroma, spec.has_alpha))
        frame.pts = round((time_s - self._start_s) / spec.time_base)
        if self._last_pts is not None and frame.pts <= self._last_pts:
            frame.pts = self._last_pts + 1
        self._last_pts = frame.pts
        frame.time_base = spec.time_base
        length = duration_s if duration_s is not None else 1 / spec.frame_rate
        frame.duration = max(1, round(length / spec.time_base))
        self._lengths[frame.pts] = frame.duration
        if message is not None:
            self._messages[frame.pts] = message
        self._frames += 1
        self._end_s = time_s + length
        tag_signal(frame, spec.signal)
        try:
            self._mux(self._stream.encode(frame))
        except (av.FFmpegError, OSError, ValueError) as error:
            raise _failure(error, self.path, self._source is not None) from error

    def finish(self, light: Light | None) -> None:
        """Flush, copy the rest of the sound, fill in MaxCLL and MaxFALL, and rename the file."""
        try:
            self._mux(self._stream.encode(None))
            self._mux_sound(None if self._is_whole else self._end_s)
            self._box.close()
            if light is not None and self.spec.signal == "pq":
                found = metadata.complete_light(self._temp, self.spec.codec, light)
                if self.spec.codec not in MASTERS and not found:
                    raise OutputError(
                        "the encoder wrote no light levels (MaxCLL)", where=str(self.path)
                    )
                has_boxes = self.path.suffix.lower() == ".mkv" or metadata.add_boxes(
                    self._temp, self.spec.mastering, light
                )
                if not has_boxes:  # the only carrier of HDR metadata with ProRes and DNxHR
                    raise OutputError(
                        "the HDR metadata (mdcv, clli) could not be added", where=str(self.path)
                    )
            self._gate.put(self._temp)
        except (av.FFmpegError, OSError, ValueError) as error:
            raise _failure(error, self.path, self._source is not None) from error

    def close(self) -> None:
        """Close everything and remove an unfinished file."""
        for thing in (getattr(self, "_box", None), self._source):
            # Closing an unfinished film writes its end, which fails again where writing failed.
            with suppress(av.FFmpegError, OSError, ValueError):
                if thing is not None:
                    thing.close()
        with suppress(OSError):
            self._temp.unlink()

    def _add_video(self) -> Any:
        spec = self.spec
        stream: Any = self._box.add_stream(
            ENCODERS[spec.codec], rate=spec.frame_rate, options=encoder_options(spec)
        )
        stream.width, stream.height = spec.width, spec.height
        stream.pix_fmt = pixel_format(spec.chroma, spec.has_alpha)
        context = stream.codec_context
        context.time_base = spec.time_base
        stream.time_base = spec.time_base
        context.sample_aspect_ratio = spec.pixel_aspect
        context.gop_size = max(1, round(2 * spec.frame_rate))  # so that players can seek
        if spec.codec == "hevc":
            context.codec_tag = "hvc1"  # Apple's players require it
        tag_signal(context, spec.signal)
        with svt_as_guest():
            context.open()
        return stream

    def _add_sound(self, source: Sound) -> None:
        self.notices += source.notices
        chapters = source.chapters()
        if chapters and self._is_whole:
            self._box.set_chapters(chapters)
        if self._is_whole:
            # Captures start at any time; sound with priming before 0 is kept.
            self._start_s = max(Fraction(0), min(self._start_s, source.first_s))
        self._sound = source.packets()

    def _mux(self, packets: list[Any]) -> None:
        for encoded in packets:
            packet = self._with_message(encoded)
            if packet.pts is not None:
                if self.spec.codec == "hevc" and self._frames <= _X265_REORDERS:
                    packet.dts = packet.pts
                # Dropped by encoders, but at a variable rate the last frame needs its duration.
                packet.duration = self._lengths.pop(packet.pts, packet.duration)
                self._mux_sound(packet.pts * Fraction(packet.time_base) + self._start_s)
            self._box.mux(packet)

    def _with_message(self, packet: Any) -> Any:
        message = self._messages.pop(packet.pts, None)
        if message is None:
            return packet
        assert self.spec.codec == "hevc" or self.spec.codec == "av1"
        out: Any = av.Packet(with_message(bytes(packet), message, self.spec.codec))
        out.pts, out.dts, out.time_base = packet.pts, packet.dts, packet.time_base
        out.duration, out.is_keyframe = packet.duration, packet.is_keyframe
        out.stream = self._stream
        return out

    def _mux_sound(self, until_s: Fraction | None) -> None:
        """Copy the sound packets that start before `until_s` (source time)."""
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
            # A codec's priming before 0 is part of a whole film's sound.
            if not self._is_whole and at + (packet.duration or 0) * base <= self._start_s:
                continue
            shift = round(self._start_s / base)
            packet.pts -= shift
            if packet.dts is not None:
                packet.dts -= shift
            self._box.mux(packet)


def _failure(error: Exception, path: Path, has_sound: bool) -> OutputError:
    check_memory(error)
    number = getattr(error, "errno", None)
    if number in NO_SPACE:  # FFmpeg's errors have the system's numbers
        return output_error(OSError(number, os.strerror(number)), path, RUN_AGAIN)
    reason = getattr(error, "strerror", None) or str(error)
    sound = "If the container does not support the sound, try .mkv, or --no-audio."
    return OutputError(
        f"cannot be encoded: {reason}", where=str(path), remedy=sound if has_sound else None
    )
