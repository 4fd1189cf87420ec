"""Video files as clips: decoded by frame number, in presentation order (PyAV)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from itertools import chain, islice
from pathlib import Path
from typing import Any

import av
import numpy as np

from itmo_video.errors import DamagedInputError, InputError
from itmo_video.model import ClipInfo, Encoding, Frame
from itmo_video.source import files, tags
from itmo_video.source.clip import Clip
from itmo_video.source.deinterlace import LEAD_IN, can_deinterlace, deinterlaced
from itmo_video.source.files import content_digest
from itmo_video.source.packets import (
    decoder_limit,
    open_video,
    packet_step,
    read_packets,
    scan_packets,
)
from itmo_video.source.planes import picture_of, pixel_form, read_picture, upright
from itmo_video.source.tags import InputOptions

_FILM_CODECS = ("mpeg2video", "vc1")  # in which films are telecined frame by frame
_SAMPLE = 30  # frames looked at for telecine
_INTERLACED = {2: "tff", 3: "bff", 4: "tff", 5: "bff"}  # FFmpeg's AVFieldOrder
_INDEXED = ("mov", "matroska", "avi", "mxf")  # containers that are read by whole packets
_LIMITED_GREY = ("h264", "hevc", "av1", "libdav1d", "vp9", "mpeg2video", "mpeg4")


class VideoClip(Clip):
    """A video file."""

    def __init__(self, path: Path, options: InputOptions) -> None:
        self._path, self._options = path, options
        # A decoder at the first frame, which is the slowest one: who reads from there goes on.
        self._begun: list[Iterator[tuple[int, Any, bool]]] = []
        try:
            self._probe()
        except av.FFmpegError as error:
            raise InputError(f"cannot be read ({error.strerror})", where=str(path)) from error

    def frames(self, start: int = 0) -> Iterator[Frame]:
        """Yield frames from index `start` on; from the nearest point before that decodes alike."""
        ahead = max(0, start - LEAD_IN) if self._deinterlace else start
        try:
            begun = self._begun.pop()  # whoever comes first, if threads read side by side
        except IndexError:
            begun = None
        pictures = begun if begun is not None and ahead == 0 else self._numbered(ahead)
        if self._deinterlace:
            pictures = deinterlaced(pictures, self._is_forced, self._time_base, self._is_same)
        for index, decoded, is_damaged in pictures:
            if index >= start:
                self._check_same(index, decoded)
                yield self._frame(index, decoded, is_damaged)

    def close(self) -> None:
        """Release the source."""
        self._begun.clear()

    def _probe(self) -> None:
        path, options = self._path, self._options
        with open_video(path, options.max_pixels) as (container, stream):
            self._packets = scan_packets(container, stream)
            self._time_base = Fraction(stream.time_base or 1)
            self._codec = codec = str(stream.codec_context.name)
            order = _INTERLACED.get(int(stream.codec_context.field_order), "progressive")
            is_doubtful = order != "progressive" or str(container.format.name) == "avi"
            first = self._first_frame(is_doubtful)
            files.check_pixels(first.width, first.height, options.max_pixels, str(path))
            self._size = (first.width, first.height)
            self._form = pixel_form(first)
            picture = picture_of(path, first)
            self._stored, told = tags.resolve_encoding(
                tags.read_tags(first, stream.codec_context),
                options,
                family=picture.family,
                bit_depth=picture.bit_depth,
                has_alpha=picture.has_alpha,
                is_full_format="yuvj" in first.format.name
                or (picture.family == "grey" and codec not in _LIMITED_GREY),
                is_still=str(container.format.name) in ("gif", "apng"),
                codec=codec,
                lines=first.height,
                where=str(path),
            )
            self._turn = tags.frame_turn(first)
            _, shown = upright(picture.planes, self._turn, self._stored)
            is_interlaced = order != "progressive" or bool(first.interlaced_frame)
            if is_interlaced and order == "progressive":
                order = "interlaced"
            self._is_forced = options.deinterlace == "force"
            self._deinterlace = (
                options.deinterlace != "off"
                and (is_interlaced or self._is_forced)
                and can_deinterlace(first, self._is_forced)
            )
            notices = list(told)
            if is_interlaced or self._is_forced:
                done = "deinterlaced" if self._deinterlace else "left as it is"
                notices.append(f"it is {'' if is_interlaced else 'not '}flagged interlaced: {done}")
            if is_interlaced or codec in _FILM_CODECS:
                notices += self._mixture()
            if not self._packets.is_exact:
                notices.append("its time stamps are incomplete: frames are counted from the start")
            self.info = self._describe(container, stream, shown, order, notices)

    def _mixture(self) -> list[str]:
        """A word about telecine: interlaced and progressive frames in turn in the first frames."""
        flags = [bool(frame.interlaced_frame) for frame in islice(self._decoded(None), _SAMPLE)]
        if all(flags) or not any(flags):
            return []
        return [
            f"{sum(flags)} of its first {len(flags)} frames are interlaced, others not: perhaps "
            "telecined film; no inverse telecine is done"
        ]

    def _first_frame(self, is_doubtful: bool) -> Any:
        """The first frame that decodes; finds out on the way whether packets can be counted."""
        if self._packets.is_exact and is_doubtful:
            head = (self._packets.index_of(f.pts) for f in islice(self._decoded(None), 24))
            found = [index for index in head if index is not None]
            # AVI stamps packets in the file's order; an interlaced frame may be two packets.
            is_shuffled = found != sorted(found)
            is_halved = len(found) > 1 and all(index % 2 == 0 for index in found)
            if is_shuffled or is_halved:
                self._packets = replace(self._packets, is_exact=False)
        if self._packets.is_exact:
            pictures = self._numbered(0)
            for picture in pictures:
                self._begun.append(chain((picture,), pictures))
                return picture[1]
        count, first = 0, None
        for count, frame in enumerate(self._decoded(None), 1):  # noqa: B007 - the last count
            first = first or frame
        if first is not None:
            stamps = tuple(range(count))
            self._packets = replace(self._packets, pts=stamps, is_exact=False, declared=None)
            return first
        raise InputError(
            "no frame of it can be decoded: it is damaged, encrypted or has none",
            where=str(self._path),
        )

    def _numbered(self, start: int) -> Iterator[tuple[int, Any, bool]]:
        """Decoded frames with their indices, rising, from somewhere at or before `start` on."""
        packets = self._packets
        if not packets.is_exact:
            yield from (
                (n, frame, bool(frame.is_corrupt)) for n, frame in enumerate(self._decoded(None))
            )
            return
        if start >= len(packets.pts):
            return
        last = -1
        for frame in self._decoded(self._entry(start)):
            index = packets.index_of(frame.pts)
            if index is not None and index > last:
                last = index
                yield index, frame, bool(frame.is_corrupt)

    def _entry(self, start: int) -> tuple[int, int, int] | None:
        """The key packet to decode from so that frame `start` comes out whole; None for the first.

        It comes before the frame both in the file and on the screen: a frame shown before its key
        packet may refer to the group before. One more for H.264, whose key packets may be points
        of gradual recovery.
        """
        pts = self._packets.pts[start]
        place = self._packets.order[pts][0]
        usable = [key for key in self._packets.keys if key[0] <= place and key[1] <= pts]
        back = 2 if self._codec == "h264" else 1
        return usable[-back] if len(usable) >= back and usable[-back][0] > 0 else None

    def _decoded(self, entry: tuple[int, int, int] | None) -> Iterator[Any]:
        """Decode from a key packet on, past packets that fail."""
        # By either stamp, as containers differ in what they seek by; else from further back.
        stamps: list[int | None] = [None]
        if entry is not None:
            before = [key[1] for key in self._packets.keys if key[0] < entry[0]][-2:]
            stamps = [*entry[1:], *reversed(before), None]
        for stamp in stamps:
            with open_video(self._path, self._options.max_pixels) as (container, stream):
                packets: Iterator[Any] | None = read_packets(container, stream)
                if entry is not None and stamp is not None:
                    packets = self._after_seek(container, stream, entry[0], stamp)
                if packets is not None:
                    yield from _decode_all(_decoder(stream, self._options.max_pixels), packets)
                    return

    def _after_seek(
        self, container: Any, stream: Any, place: int, stamp: int
    ) -> Iterator[Any] | None:
        """Packets from the one at `place` on, wherever the seek lands; None if it lands later."""
        # Without an index a seek lands within a packet, whose rest then bears a whole one's stamp.
        is_whole = str(container.format.name).startswith(_INDEXED)
        try:
            container.seek(stamp, stream=stream, backward=True)
            packets = read_packets(container, stream)
            for packet in packets:
                at, size = self._packets.order.get(packet.pts, (-1, 0))
                if at == place and is_whole and packet.size == size:
                    return chain((packet,), packets)
                if at >= place:
                    return None
                is_whole = is_whole or at >= 0
        except (av.FFmpegError, OSError):
            pass
        return None

    def _is_same(self, decoded: Any) -> bool:
        size = decoded.width, decoded.height
        return bool(size == self._size and pixel_form(decoded) == self._form)

    def _check_same(self, index: int, decoded: Any) -> None:
        if self._is_same(decoded):
            return
        now = f"{decoded.width}x{decoded.height} {pixel_form(decoded)}"
        raise DamagedInputError(
            f"frame {index} is {now}, not {self._size[0]}x{self._size[1]} {self._form} as before",
            where=str(self._path),
            remedy="What came before it can be converted; split the file where it changes.",
        )

    def _frame(self, index: int, decoded: Any, is_damaged: bool) -> Frame:
        planes = read_picture(decoded).planes
        count = {"ycbcr": 3, "rgb": 3, "grey": 1}[self._stored.family] + self._stored.has_alpha
        if len(planes) < count:  # a palette without transparency, in a clip that has it
            planes = (*planes, np.full_like(planes[0], 255))
        planes, encoding = upright(planes[:count], self._turn, self._stored)
        return Frame(index, self.time_s(index), planes, encoding, is_damaged)

    def time_s(self, index: int) -> Fraction:
        """Presentation time as stamped; counted at the frame rate where stamps are unusable."""
        if self._packets.is_exact:
            return self._packets.pts[index] * self._time_base
        return Fraction(index) / self.info.frame_rate

    # -- what is known

    def _describe(
        self, container: Any, stream: Any, shown: Encoding, field_order: str, notices: list[str]
    ) -> ClipInfo:
        packets, context = self._packets, stream.codec_context
        rate = Fraction(stream.average_rate or stream.guessed_rate or 25)
        count, length, is_vfr = len(packets.pts), len(packets.pts) / rate, False
        step = packet_step(packets.pts) if packets.is_exact else None
        if step is not None:
            measured = 1 / (step * self._time_base)
            rate = rate if 0.8 < rate / measured < 1.25 or rate < measured else measured
            length = (packets.pts[-1] - packets.pts[0] + step) * self._time_base
            # Where a file is cut off, its last frames lack some of those shown before them.
            whole = (
                packets.pts[:-16] if count > 48 or (packets.declared or 0) > count else packets.pts
            )
            steps = np.diff(np.asarray(whole, np.int64))
            # Matroska counts in whole milliseconds, so steps of a constant rate differ by one.
            is_vfr = steps.size > 0 and int(np.ptp(steps)) > max(1, step // 50)
        if is_vfr:
            notices.append("its frame rate varies: each frame keeps its own time")
        if packets.declared is not None and packets.declared > count:
            notices.append(
                f"it is cut short: {packets.declared - count} frames are missing at its end"
            )
        aspect = Fraction(stream.sample_aspect_ratio or context.sample_aspect_ratio or 1)
        rotation, flip = self._turn
        if rotation or flip:
            mirrored = "mirrored, then " if flip else ""
            notices.append(f"turned upright: {mirrored}{rotation} degrees clockwise")
        codes = (s.metadata.get("timecode") for s in (container, *container.streams))
        return ClipInfo(
            path=str(self._path),
            stem=self._path.stem,
            container=str(container.format.name),
            codec=self._codec,
            pixel_format=self._form,
            width=self._size[0],
            height=self._size[1],
            frames=count,
            frame_rate=rate,
            duration_s=length,
            is_vfr=is_vfr,
            pixel_aspect=1 / aspect if rotation % 180 else aspect,
            rotation_deg=rotation,
            flip=flip,
            field_order=field_order,
            timecode=next((_printable(code) for code in codes if code), None),
            encoding=shown,
            digest=content_digest([self._path]),
            notices=tuple(notices),
            frames_declared=packets.declared,
        )


def _printable(tag: str) -> str:
    return tag.encode(errors="replace").decode()  # bytes that are not UTF-8 come as surrogates


def _decoder(stream: Any, max_pixels: int) -> Any:
    """The stream's decoder; for VP8 and VP9 with alpha libvpx, which alone decodes that."""
    context = stream.codec_context
    name = {"vp8": "libvpx", "vp9": "libvpx-vp9"}.get(str(context.name))
    if name is None or stream.metadata.get("alpha_mode") != "1" or name not in av.codecs_available:
        return context
    alone = av.CodecContext.create(name, "r")
    alone.options = {"max_pixels": decoder_limit(max_pixels)}
    return alone


def _decode_all(context: Any, packets: Iterator[Any]) -> Iterator[Any]:
    while True:
        packet = next(packets, None)
        try:
            frames = context.decode(packet)
        except (av.FFmpegError, EOFError):
            frames = []
        yield from frames
        if packet is None or packet.size == 0:
            return
