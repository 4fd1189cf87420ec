"""Damage in a stream that can be read only once, found packet by packet as in files.

A file is decoded strictly up to damage, and past it again from its stretch's key packet (see
`stretches`). A pipe cannot go back, but need not where packets are frames in presentation order.
"""

from __future__ import annotations

import io
from collections import deque
from collections.abc import Callable, Iterator
from typing import Any

import av

from itmo_video.memory_limit import check_memory
from itmo_video.source.decoding import decode_all, decoder_of
from itmo_video.source.ffv1_slices import packet_check
from itmo_video.source.packets import CHECKS, decoder_limit
from itmo_video.source.stretches import AT_RANDOM, INTRA, SHORTEST, copied

_INTERLACED = 2  # of AVFieldOrder: from here on
_BOTH_FIELDS = (  # in each packet, as far as they are interlaced
    "prores", "dnxhd", "ffv1", "dvvideo", "huffyuv", "ffvhuff", "utvideo", "cfhd",
)  # fmt: skip
_CHAINED = ("ffv1", "flashsv")  # frames in order that may refer to the one before
_ALONE = (*INTRA, "png")  # not marked as intra-only in FFmpeg
_PLAIN = ("rawvideo", "wrapped_avframe")  # nothing to decode; see PipeClip

Judged = tuple[Any, bool]  # decoded frame, whether it is damaged


def is_judged(stream: Any) -> bool:
    """Whether the damage of a stream can be found as in its file: a packet is a frame, in order."""
    name = str(stream.codec_context.name)
    try:
        is_alone = av.Codec(name, "r").intra_only or name in _ALONE
    except ValueError:  # FFmpeg has no decoder for it
        return False
    is_whole = int(stream.codec_context.field_order) < _INTERLACED or name in _BOTH_FIELDS
    return is_whole and (is_alone or name in _CHAINED) and name not in _PLAIN


def judged_frames(
    stream: Any,
    max_pixels: int,
    packets: Iterator[Any],
    where: str,
    on_fields: Callable[[], None],
) -> Iterator[Judged]:
    """The frames of packets, marked as far as one reading can tell.

    `on_fields` is called before the first frame if each is two packets. Raises InputError, which
    names `where`, if FFmpeg has no decoder for them.
    """
    if not is_judged(stream):
        for frame in decode_all(decoder_of(stream, max_pixels), packets, where):
            yield frame, bool(frame.is_corrupt)
        return
    decoder = _JudgedDecoder(stream, max_pixels)
    for item in decoder.frames(packets):
        if decoder.is_halved:
            on_fields()
        yield item


class _JudgedDecoder:
    """Decodes packets in order, and marks the frames that are marked in a file."""

    def __init__(self, stream: Any, max_pixels: int) -> None:
        self._stream, self._max_pixels = stream, max_pixels
        self._codec = str(stream.codec_context.name)
        self._is_chained = self._codec in _CHAINED
        self._main = decoder_of(stream, max_pixels, "lenient" if self._is_chained else "strict")
        self._past: Any = None  # of packets behind damage, up to the stretch's end
        self._is_damaged = False  # whether a packet of this stretch failed
        self._is_checked = False  # whether incomplete packets are left out
        self._before: deque[Any] = deque(maxlen=2)  # the stretch's packets before this one
        self._held: Any = None  # frames of the latest packet: what is held, as in `Stretches`,
        # decides which buffer is next, and so what shows where the next packet has nothing
        self._number, self._entry = -1, 0  # of packets that are shown
        self.is_halved = False  # whether a frame is two packets
        self._is_sound = packet_check() if self._codec == "ffv1" else None

    def frames(self, packets: Iterator[Any]) -> Iterator[Judged]:
        """The frames of packets, up to the end of the stream."""
        for packet, is_whole in self._with_checks(packets):
            if packet.size and not packet.is_discard:
                self._number += 1
                if packet.is_keyframe and self._number >= self._entry + SHORTEST:
                    self._entry, self._is_damaged = self._number, False
                    self._begin_stretch()
            if self._is_checked and not is_whole:
                self._is_damaged = True
                continue
            if self._is_sound is not None and packet.size:
                self._is_damaged = not self._is_sound(bytes(packet)) or self._is_damaged
            yield from self._decoded(packet)
            self._before.append(packet)
            if not packet.size:
                return

    def _begin_stretch(self) -> None:
        self._before.clear()
        self._held = None
        self._past = _another(self._stream, self._max_pixels) if self._is_chained else None

    def _with_checks(self, packets: Iterator[Any]) -> Iterator[tuple[Any, bool]]:
        """Packets, and whether each is whole.

        Until one is, it may be a stream of a kind that cannot be checked. So the first whole one is
        waited for, for a stretch's length at most.
        """
        check = CHECKS.get(self._codec)
        held: list[tuple[Any, bool]] = []
        for packet in packets:
            is_end = not packet.size
            is_whole = is_end or check is None or check(bytes(packet))
            self._is_checked = self._is_checked or not (is_end or check is None or not is_whole)
            held.append((packet, is_whole))
            if check is None or self._is_checked or is_end or self._number + len(held) >= SHORTEST:
                yield from held
                held.clear()
        yield from held

    def _decoded(self, packet: Any) -> Iterator[Judged]:
        if self._is_chained or self._past is not None:
            yield from self._leniently(packet)
            return
        try:
            frames = self._main.decode(packet)
        except (av.FFmpegError, EOFError) as error:
            check_memory(error)
            self._is_damaged, frames = True, None
        if frames is None or any(frame.is_corrupt for frame in frames):
            # As from the key packet on; only the two frames before can show in this one.
            self._past = _another(self._stream, self._max_pixels)
            for before in self._before:
                self._held = self._past.decode(before)
            yield from self._leniently(packet)
            return
        self._see(packet, bool(frames))
        for frame in frames:
            yield frame, False

    def _see(self, packet: Any, has_frame: bool) -> None:
        """Notice fields that are packets: of the first two, one gives no frame."""
        if packet.size and self._number < 2 and not has_frame:
            self.is_halved = True

    def _leniently(self, packet: Any) -> Iterator[Judged]:
        decoder = self._main if self._past is None else self._past
        try:
            frames = decoder.decode(packet)
        except (av.FFmpegError, EOFError) as error:
            check_memory(error)
            self._is_damaged, frames = True, []
        else:
            self._see(packet, bool(frames))
        self._held = frames or self._held
        for frame in frames:
            follows = self._is_damaged and not (self._is_checked and self._codec in INTRA)
            is_damaged = bool(frame.is_corrupt) or follows
            if is_damaged and self._codec in AT_RANDOM and not self._is_checked:
                continue  # it may show memory that was never written
            yield copied((0, frame, is_damaged))[1:]


def _another(stream: Any, max_pixels: int) -> Any:
    """A new decoder of the stream, as a file's are that is opened again."""
    with av.open(io.BytesIO(), "w", format="null") as box:
        context: Any = box.add_stream_from_template(stream, opaque=True).codec_context
    context.codec_tag = stream.codec_context.codec_tag
    context.options = {"max_pixels": decoder_limit(max_pixels)}
    context.thread_type, context.thread_count = "NONE", 1
    return context
