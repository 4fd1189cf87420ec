"""Clips from standard input or a FIFO, which can be read only once."""

from __future__ import annotations

import hashlib
import os
import re
import stat
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from heapq import heappop, heappush
from itertools import chain
from pathlib import Path
from typing import Any

import av

from itmo_video.errors import InputError, UsageError
from itmo_video.memory_limit import check_memory
from itmo_video.model import ASSUMED_STREAM_RATE
from itmo_video.source.decoding import Decoder, Numbered, Way
from itmo_video.source.frame_timing import stated_rate
from itmo_video.source.packets import (
    CONTAINERS,
    TAG_ERRORS,
    Packets,
    decoder_limit,
    frames_after,
    is_hidden,
    prepare_decoder,
)
from itmo_video.source.pipe_damage import is_judged, judged_frames
from itmo_video.source.pipe_input import BUFFER_BYTES, STANDARD_INPUT, PipeInput
from itmo_video.source.planes import read_picture
from itmo_video.source.stamp_jumps import Jumps
from itmo_video.source.stream_facts import CAPTURES, facts_at
from itmo_video.source.streams import choose_video
from itmo_video.source.tags import InputOptions
from itmo_video.source.video import VideoClip
from itmo_video.untrusted import parse_rational
from itmo_video.words import missing

_RAW = re.compile(r"(?P<form>[a-z0-9]+):(?P<size>\d{1,6}x\d{1,6}):(?P<rate>\d+(?:/\d+|\.\d+)?)")
_REMEDY = (
    "Pipe Y4M, Matroska, NUT or MPEG-TS (MP4 only if its index comes first, or it is fragmented); "
    "frames without a header need --raw FORMAT:WIDTHxHEIGHT:FPS."
)


def is_pipe(path: str | os.PathLike[str]) -> bool:
    """Whether it is standard input or output ("-") or a FIFO, such as a shell's <(command)."""
    if os.fspath(path) == STANDARD_INPUT:
        return True
    try:
        return stat.S_ISFIFO(os.stat(path).st_mode)
    except (OSError, ValueError):
        return False


class PipeClip(VideoClip):
    """A piped stream: `frames` yields each frame once; `info.frames` is 0, as its end is unknown.

    Frames are numbered as in the same file on disk. `lost` collects the indices of frames that
    cannot be decoded; `broken` says how the stream broke off, once it has.
    """

    reads_once = True

    def __init__(self, source: str | os.PathLike[str], options: InputOptions) -> None:
        name = os.fspath(source)
        self.lost: list[int] = []
        self.broken: str | None = None
        self._times: dict[int, Fraction] = {}
        self._raw_bytes = 0  # of a frame without header
        if options.fps is not None:
            raise UsageError(
                "a pipe cannot be resampled", remedy="Resample it before: ffmpeg ... -r 25 -f nut -"
            )
        if options.raw is not None:
            raw_format(options.raw)  # checked before any of the stream is consumed
        self._input = PipeInput(name)
        self._where = "standard input" if name == STANDARD_INPUT else name
        try:
            self._open(options)
        except av.FFmpegError as error:
            check_memory(error)
            what = f"not a readable video ({error.strerror})"
            raise InputError(what, where=self._where, remedy=_REMEDY) from error
        pictures = self._numbered(options.max_pixels)
        first = next(pictures, None)
        if first is None:
            raise InputError("no frame could be decoded", where=self._where, remedy=_REMEDY)
        codec = str(self._stream.codec_context.name)
        decoder = _Once(
            Path(name), options.max_pixels, Packets((), {}, (), True), codec, self._stream.index
        )
        facts = facts_at(
            self._container, self._stream, decoder, first[1], options, _digest(first[1]),
            head=self._input.head,
        )  # fmt: skip
        stem = "stdin" if name == STANDARD_INPUT else Path(name).stem
        self.info = replace(facts.info, path=self._where, stem=stem)
        self._facts = replace(facts, info=self.info)
        self._begun = [chain((first,), pictures)]

    def time_s(self, index: int) -> Fraction:
        """The presentation time of the next frame."""
        return self._times.pop(index)

    def close(self) -> None:
        """Stop reading; a waiting reader gets the end of the stream."""
        super().close()
        self._input.close()

    def _open(self, options: InputOptions) -> None:
        demuxer = {"format_whitelist": CONTAINERS, "max_pixels": decoder_limit(options.max_pixels)}
        form = None
        if options.raw is not None:
            form, parts = "rawvideo", raw_format(options.raw)
            demuxer = dict(zip(("pixel_format", "video_size", "framerate"), parts, strict=True))
        self._container: Any = av.open(
            self._input, format=form, options=demuxer, buffer_size=BUFFER_BYTES, **TAG_ERRORS
        )
        self._stream, _ = choose_video(self._container, options.stream, self._where)
        prepare_decoder(self._stream, options.max_pixels, self._where)

    def _check_source(self) -> None:
        """Does nothing, as a pipe has no files that could change."""

    def _check_readable(self) -> None:
        """Does nothing, as a pipe has no disk that could fail."""

    def _check_disk_end(self) -> None:
        """Does nothing, likewise."""

    def _numbered(self, max_pixels: int) -> Iterator[Numbered]:
        """Frames in presentation order; an index is the number of packets shown before it."""
        stream, base = self._stream, Fraction(self._stream.time_base or 1)
        stamps = _Stamps(self._container, stream)
        rate = stated_rate(stream, self._input.head) or ASSUMED_STREAM_RATE
        index = 0
        packets = self._packets(stamps)
        for frame, is_damaged in judged_frames(
            stream, max_pixels, packets, self._where, stamps.stop_at_fields
        ):
            if stamps.is_before_first_key(frame.pts):
                continue
            lost = stamps.passed(frame.pts)
            self.lost.extend(range(index, index + lost))
            index += lost
            self._times[index] = Fraction(index) / rate if frame.pts is None else frame.pts * base
            yield index, frame, is_damaged
            index += 1
        self.lost.extend(range(index, index + stamps.left))

    def _packets(self, stamps: _Stamps) -> Iterator[Any]:
        codec = str(self._stream.codec_context.name)
        end = 0
        try:
            for packet in self._container.demux(self._stream):
                if self._is_cut_off(packet):
                    break
                if not packet.size:
                    self._check_end(end, stamps.end)
                elif not is_hidden(packet, codec):
                    stamps.see(packet)
                end = (packet.pos or 0) + packet.size
                yield packet
        except (av.FFmpegError, OSError, IndexError) as error:
            check_memory(error)
            self.broken = f"the stream breaks off ({getattr(error, 'strerror', None) or error})"

    def _is_cut_off(self, packet: Any) -> bool:
        """Whether this is only a part of a frame without header: the last, or --raw is wrong."""
        if self._container.format.name != "rawvideo" or not packet.size:
            return False
        self._raw_bytes = self._raw_bytes or packet.size
        if packet.size == self._raw_bytes:
            return False
        width, height = self.info.width, self.info.height
        self.broken = f"the stream is no whole number of {width}x{height} frames: is --raw right?"
        return True

    def _check_end(self, end: int, end_pts: int) -> None:
        """Check that nothing follows the last whole frame of an uncompressed stream.

        FFmpeg ignores a truncated frame there. Others must reach the duration that they state.
        """
        is_plain = self._container.format.name in ("yuv4mpegpipe", "rawvideo")
        if is_plain and self._input.bytes_read > end:
            self.broken = "the stream breaks off within a frame"
        cut_off = frames_after(self._stream, end_pts)
        if cut_off:
            self.broken = f"the stream is truncated or damaged: {missing(cut_off, 'frame')}"


class _Stamps:
    """The stamps of packets whose frames are pending, from which lost frames are found."""

    def __init__(self, container: Any, stream: Any) -> None:
        # Otherwise a frame may be two packets, or stamps may be in another order.
        self._is_avi = container.format.name == "avi"
        self._counts = is_judged(stream) or (
            int(stream.codec_context.field_order) < 2 and not self._is_avi
        )
        self._is_capture = str(container.format.name) in CAPTURES
        self._jumps = Jumps(stream)
        self._waiting: list[int] = []
        self._first_key: int | None = None
        self.end = 0  # of the latest packet, so far

    @property
    def left(self) -> int:
        """The number of packets whose frames are pending."""
        return len(self._waiting) if self._counts else 0

    def stop_at_fields(self) -> None:
        """Stop counting an AVI's frames, as each is two packets."""
        self._counts = self._counts and not self._is_avi

    def see(self, packet: Any) -> None:
        """Record a packet before it is decoded."""
        if self._jumps.see(packet.dts if packet.dts is not None else packet.pts):
            self._counts = False  # joined captures: their stamps start again
        if packet.pts is None or packet.is_discard:
            return
        self.end = max(self.end, packet.pts + int(packet.duration or 0))
        if packet.is_keyframe and self._first_key is None:
            self._first_key = packet.pts
        if self._counts and not self.is_before_first_key(packet.pts):
            heappush(self._waiting, packet.pts)

    def is_before_first_key(self, pts: int | None) -> bool:
        """Whether a capture's frame refers to frames before the capture, so is not part of it."""
        if not (self._is_capture and self._counts) or pts is None:
            return False
        return self._first_key is None or pts < self._first_key

    def passed(self, pts: int | None) -> int:
        """The number of frames expected before the one with this stamp."""
        lost = 0
        while self._counts and pts is not None and self._waiting and self._waiting[0] < pts:
            heappop(self._waiting)
            lost += 1
        if self._counts and self._waiting and self._waiting[0] == pts:
            heappop(self._waiting)
        return lost


def raw_format(text: str) -> tuple[str, str, str]:
    """(pixel format, WIDTHxHEIGHT, frame rate) of "yuv420p10le:1920x1080:24000/1001".

    Raises UsageError for anything else.
    """
    found = _RAW.fullmatch(text)
    try:
        is_known = found is not None and av.VideoFormat(found["form"]) is not None
    except ValueError:
        is_known = False
    sizes = [] if found is None else [int(n) for n in found["size"].split("x")]
    if found is None or not is_known or 0 in sizes or not _is_rate(found["rate"]):
        raise UsageError(
            f"--raw must be FORMAT:WIDTHxHEIGHT:FPS, not {text!r}",
            remedy="Examples: yuv420p:1920x1080:25, yuv422p10le:1920x1080:30000/1001.",
        )
    return found["form"], found["size"], found["rate"]


def _is_rate(text: str) -> bool:
    try:
        return 0 < parse_rational(text) <= 1000
    except ValueError:
        return False


@dataclass(frozen=True)
class _Once(Decoder):
    """A decoder at its position in the stream, which cannot go back."""

    def decoded(
        self,
        entry: tuple[int, ...] | None,
        way: Way = "lenient",
        on_error: Callable[[Any], bool] = lambda packet: False,
    ) -> Iterator[Any]:
        return iter(())


def _digest(first: Any) -> str:
    """A digest of the first frame, as the rest is not there yet; not valid for resuming."""
    digest = hashlib.blake2b(f"pipe {first.format.name}".encode(), digest_size=16)
    for plane in read_picture(first).planes:
        digest.update(plane.tobytes())
    return digest.hexdigest()
