"""A video stream decoded by frame number: from a key packet on, wherever a seek lands."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import av

from itmo_video.source.packets import Packets, decoder_limit, open_video, read_packets

_INDEXED = ("mov", "matroska", "avi", "mxf")  # containers that are read by whole packets

Numbered = tuple[int, Any, bool]  # index, decoded frame, whether it is damaged


@dataclass(frozen=True)
class Decoder:
    """A stream's frames by number, as its packets tell them; opens the file anew for each reader.

    Where the packets are not exact, frames are counted by decoding from the start.
    """

    path: Path
    max_pixels: int
    packets: Packets
    codec: str
    stream: int | None = None

    def numbered(self, start: int) -> Iterator[Numbered]:
        """Decoded frames with their indices, rising, from somewhere at or before `start` on."""
        packets = self.packets
        if not packets.is_exact:
            yield from (
                (n, frame, bool(frame.is_corrupt)) for n, frame in enumerate(self.decoded(None))
            )
            return
        if start >= len(packets.pts):
            return
        last, before = -1, None
        for frame in self.decoded(self._entry(start)):
            index = packets.index_of(frame.pts)
            if index is not None and index > last:
                yield from self._repeated(last, index, before)
                last, before = index, frame
                yield index, frame, bool(frame.is_corrupt)
        yield from self._repeated(last, len(packets.pts), before)

    def _repeated(self, last: int, until: int, frame: Any) -> Iterator[Numbered]:
        """The frame `last` again, for those after it that have no packet of their own."""
        if frame is None or not self.packets.repeats:
            return
        for index in range(last + 1, until):
            if self.packets.pts[index] not in self.packets.repeats:
                return
            yield index, frame, bool(frame.is_corrupt)

    def decoded(self, entry: tuple[int, int, int] | None) -> Iterator[Any]:
        """Decode from a key packet on, None for the first, past packets that fail."""
        # By either stamp, as containers differ in what they seek by; else from further back.
        stamps: list[int | None] = [None]
        if entry is not None:
            before = [key[1] for key in self.packets.keys if key[0] < entry[0]][-2:]
            stamps = [*entry[1:], *reversed(before), None]
        for stamp in stamps:
            with open_video(self.path, self.max_pixels, self.stream) as (container, stream):
                packets: Iterator[Any] | None = read_packets(container, stream)
                if entry is not None and stamp is not None:
                    packets = self._after_seek(container, stream, entry[0], stamp)
                if packets is not None:
                    yield from decode_all(decoder_of(stream, self.max_pixels), packets)
                    return

    def _entry(self, start: int) -> tuple[int, int, int] | None:
        """The key packet to decode from so that frame `start` comes out whole; None for the first.

        It comes before the frame both in the file and on the screen: a frame shown before its key
        packet may refer to the group before. One more for H.264, whose key packets may be points
        of gradual recovery.
        """
        while start > 0 and self.packets.pts[start] in self.packets.repeats:
            start -= 1
        pts = self.packets.pts[start]
        place = self.packets.order[pts][0]
        usable = [key for key in self.packets.keys if key[0] <= place and key[1] <= pts]
        back = 2 if self.codec == "h264" else 1
        return usable[-back] if len(usable) >= back and usable[-back][0] > 0 else None

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
                at, size = self.packets.order.get(packet.pts, (-1, 0))
                if at == place and is_whole and packet.size == size:
                    return chain((packet,), packets)
                if at >= place:
                    return None
                is_whole = is_whole or at >= 0
        except (av.FFmpegError, OSError):
            pass
        return None


def decoder_of(stream: Any, max_pixels: int) -> Any:
    """The stream's decoder; for VP8 and VP9 with alpha libvpx, which alone decodes that."""
    context = stream.codec_context
    name = {"vp8": "libvpx", "vp9": "libvpx-vp9"}.get(str(context.name))
    if name is None or stream.metadata.get("alpha_mode") != "1" or name not in av.codecs_available:
        return context
    alone = av.CodecContext.create(name, "r")
    alone.options = {"max_pixels": decoder_limit(max_pixels)}
    return alone


def decode_all(context: Any, packets: Iterator[Any]) -> Iterator[Any]:
    """Frames of packets in presentation order, past those that fail; flushes at the end."""
    while True:
        packet = next(packets, None)
        try:
            frames = context.decode(packet)
        except (av.FFmpegError, EOFError):
            frames = []
        yield from frames
        if packet is None or packet.size == 0:
            return
