"""What damage costs a stream whose frames must be counted by decoding, as its stamps are unusable.

Without stamps a lost frame leaves no gap. So each packet gets its place as its stamp, and the
decoder hands that on to the packet's frame.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from itmo_video.source.decoding import Decoder, Losses, Way, decode_all, decoder_of
from itmo_video.source.packets import is_hidden, open_video, read_packets

_SILENT = ("hevc",)  # decoders that report damage only if they are strict


@dataclass
class _Trace:
    """A decoding by packets' places: frames in presentation order, failures and keys in file order.

    A frame whose packet is unknown is left out of `frames`.
    """

    packets: int = 0
    frames: list[int] = field(default_factory=list)
    failed: list[int] = field(default_factory=list)
    keys: list[int] = field(default_factory=list)


def find_losses(decoder: Decoder, has_failed: bool) -> Losses:
    """What damage costs; `has_failed` says whether packets failed when all were decoded leniently.

    Failures before the first frame are not damage: a capture may start anywhere.
    """
    strict = _trace(decoder, "strict") if decoder.codec in _SILENT else None
    if not has_failed and (strict is None or not strict.failed):
        return Losses()
    lenient = _trace(decoder, "lenient")
    frames = lenient.frames
    begin = min(frames, default=0)
    failed = sorted({*lenient.failed, *(strict.failed if strict is not None else ())})
    failed = [place for place in failed if place > begin]
    if not failed:
        return Losses()
    missing = _missing(lenient.packets, frames, failed)
    return Losses(lenient.packets, missing, _damaged(frames, failed, lenient.keys))


def _missing(packets: int, frames: list[int], failed: list[int]) -> int:
    """About how many frames are missing from the first failure on.

    A frame may be two packets, its fields, which shows before that.
    """
    sound = sum(place < failed[0] for place in frames)
    each = max(1, round(failed[0] / sound)) if sound else 1
    missing = round((packets - failed[0]) / each) - (len(frames) - sound)
    return max(missing, int(bool({*failed} - {*frames})))


def _damaged(frames: list[int], failed: list[int], keys: list[int]) -> frozenset[int]:
    """The indices of frames that failed or may refer to one that did.

    A frame shown before its key packet's may refer to the group before.
    """
    found, shown = [], 0
    for index, place in enumerate(frames):
        at = bisect_right(keys, place)
        key = keys[at - 1] if at else 0
        shown = max(shown, place if place == key else 0)
        since = min(key, shown)
        if bisect_right(failed, place) > bisect_right(failed, since - 1):
            found.append(index)
    return frozenset(found)


def _trace(decoder: Decoder, way: Way) -> _Trace:
    """Decode a stream from its start with places for stamps."""
    trace = _Trace()

    def placed(packets: Iterator[Any]) -> Iterator[Any]:
        for packet in packets:
            packet.pts = None
            if packet.size and not is_hidden(packet, decoder.codec):
                packet.pts = trace.packets
                trace.packets += 1
                if packet.is_keyframe:
                    trace.keys.append(packet.pts)
            yield packet

    def on_error(packet: Any) -> bool:
        if packet is not None and packet.pts is not None:
            trace.failed.append(packet.pts)
        return False

    with open_video(decoder.path, decoder.max_pixels, decoder.stream) as (container, stream):
        context = decoder_of(stream, decoder.max_pixels, way)
        packets = placed(read_packets(container, stream))
        for frame in decode_all(context, packets, str(decoder.path), on_error):
            if frame.pts is not None:
                trace.frames.append(frame.pts)
    return trace
