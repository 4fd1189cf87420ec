"""Decoding a video stream from a key packet on, wherever a seek lands."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Any, Literal, NamedTuple

import av

from itmo_video.errors import InputError
from itmo_video.memory_limit import check_memory
from itmo_video.source.ffv1_slices import packet_check
from itmo_video.source.packets import Packets, decoder_limit, open_video, read_packets
from itmo_video.source.read_faults import PROBED_BYTES, check_readable

_INDEXED = ("mov", "matroska", "avi", "mxf")  # containers that are read in whole packets

_PARTS_BYTES = 1 << 20  # of other streams, between the parts of a packet

Way = Literal["lenient", "strict"]
Numbered = tuple[int, Any, bool]  # index, decoded frame, whether it is damaged


class Losses(NamedTuple):
    """What damage costs a stream whose frames are counted by decoding.

    The number of packets, about how many frames are missing, and the indices of damaged frames.
    """

    packets: int = 0
    missing: int = 0
    damaged: frozenset[int] = frozenset()


@dataclass(frozen=True)
class Decoder:
    """Decodes a stream's frames; each reader opens the file separately."""

    path: Path
    max_pixels: int
    packets: Packets
    codec: str
    stream: int | None = None
    losses: Losses = field(default_factory=Losses)

    def decoded(
        self,
        entry: tuple[int, ...] | None,
        way: Way = "lenient",
        on_error: Callable[[Any], bool] = lambda packet: False,
    ) -> Iterator[Any]:
        """Decode from a key packet (place, pts, dts) on, None for the first.

        Single-threaded; "strict" fails where a decoder would otherwise conceal errors. `on_error`
        receives each packet that fails (None at the end) and returns whether to stop.
        """
        # By pts or dts, as containers differ in what they seek by; otherwise from further back.
        stamps: list[int | None] = [None]
        if entry is not None:
            before = [key[1] for key in self.packets.keys if key[0] < entry[0]][-2:]
            stamps = [*entry[1:3], *reversed(before), None]
        for stamp in stamps:
            with open_video(self.path, self.max_pixels, self.stream) as (container, stream):
                packets: Iterator[Any] | None = read_packets(container, stream)
                if entry is not None and stamp is not None:
                    packets = self._after_seek(container, stream, entry[0], stamp)
                if packets is not None:
                    packets = self._as_scanned(packets)
                    context = decoder_of(stream, self.max_pixels, way)
                    if self.packets.broken:
                        packets = self._without_broken(packets, on_error)
                    if way == "strict" and self.codec == "ffv1":
                        packets = _with_true_sums(packets, on_error, self.packets.has_sums)
                    yield from decode_all(context, packets, str(self.path), on_error)
                    return

    def _as_scanned(self, packets: Iterator[Any]) -> Iterator[Any]:
        """The packets as stored; raises ReplacedInputError if a disk fails only now.

        Demuxers may take that for the file's end, and return an incomplete packet.
        """
        at, end = 0, 0
        for packet in packets:
            if packet.size:
                at = packet.pos or at
                end = max(end, at + packet.size)
                _, size = self.packets.order.get(packet.pts, (0, packet.size))
                if size > packet.size:
                    check_readable(self.path, at, 2 * size + _PARTS_BYTES)
            yield packet
        if end < self.packets.end_byte:
            check_readable(self.path, at, min(self.packets.end_byte - at, PROBED_BYTES))

    def _without_broken(
        self, packets: Iterator[Any], on_error: Callable[[Any], bool]
    ) -> Iterator[Any]:
        """The packets with a complete structure, up to one for which `on_error` returns true."""
        for packet in packets:
            if packet.size and packet.pts in (self.packets.broken or ()):
                if on_error(packet):
                    return
                continue
            yield packet

    def _after_seek(
        self, container: Any, stream: Any, place: int, stamp: int
    ) -> Iterator[Any] | None:
        """Packets from the one at `place` on, wherever a seek lands; None if that is too late."""
        # Without an index a seek may land within a packet, whose rest gets a whole packet's stamp.
        is_whole = str(container.format.name).startswith(_INDEXED)
        try:
            container.seek(stamp, stream=stream, backward=True)
            packets = read_packets(container, stream)
            for packet in packets:
                at, size = self.packets.order.get(packet.pts, (-1, 0))
                if at == place and is_whole and packet.size == size:
                    return chain((packet,), packets)
                if at >= place:
                    return None
                is_whole = is_whole or at >= 0
        except (av.FFmpegError, OSError) as error:
            check_memory(error)
        return None


def decoder_of(stream: Any, max_pixels: int, way: Way = "lenient") -> Any:
    """The stream's single-threaded decoder; libvpx for VP8/VP9 with alpha, as others drop it."""
    context = stream.codec_context
    name = {"vp8": "libvpx", "vp9": "libvpx-vp9"}.get(str(context.name))
    if name and stream.metadata.get("alpha_mode") == "1" and name in av.codecs_available:
        context = av.CodecContext.create(name, "r")
        context.options = {"max_pixels": decoder_limit(max_pixels)}
    context.thread_type, context.thread_count = "NONE", 1
    if way == "strict":
        context.options = {**context.options, "err_detect": "explode"}
    return context


def _with_true_sums(
    packets: Iterator[Any], on_error: Callable[[Any], bool], has_sums: bool
) -> Iterator[Any]:
    """FFV1's packets up to one whose checksums fail and for which `on_error` returns true."""
    is_sound = packet_check(has_sums)
    for packet in packets:
        if packet.size and not is_sound(bytes(packet)) and on_error(packet):
            return
        yield packet


def decode_all(
    context: Any,
    packets: Iterator[Any],
    where: str,
    on_error: Callable[[Any], bool] = lambda packet: False,
) -> Iterator[Any]:
    """The frames of packets in presentation order, skipping failures; flushes at the end.

    Raises InputError, which names `where`, if FFmpeg has no decoder for them.
    """
    while True:
        packet = next(packets, None)
        try:
            frames = context.decode(packet)
        except (av.FFmpegError, EOFError) as error:
            check_memory(error)
            frames = []
            if on_error(packet):
                return
        except ValueError as error:
            # PyAV 19, if FFmpeg has no decoder for the stream, or cannot open it. The context is
            # gone then: asked for its name, it crashes.
            raise InputError(
                "its video codec is not supported",
                where=where,
                remedy="Convert it with its maker's program, for example to ProRes or FFV1.",
            ) from error
        yield from frames
        if packet is None or packet.size == 0:
            return
