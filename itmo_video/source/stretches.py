"""A stream's frames by number, identical wherever reading starts, even if it is damaged.

A decoder's result for damaged data depends on its threads, on where it started and on what its
buffers contained. So a frame is defined as what a new single-threaded decoder gives that starts
at the frame's entry, a fixed key packet. While no damage is found a decoder continues past
entries, with the same result; at the first damage, the stretch up to the next entry is decoded
separately. Stretches of codecs whose decoders do not report all damage are always decoded
separately.

No codec is decoded with several threads, as FFmpeg's concealment and error reports then vary.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from collections.abc import Iterator
from fractions import Fraction
from itertools import accumulate
from typing import Any, NamedTuple

import av

from itmo_video.source.decoding import Decoder, Numbered, Way

_TOLD = ("h264", "mpeg2video", "mpeg4", "libdav1d", "av1", "vp9", "prores", "dnxhd")
# Decoders that fill damaged areas with uninitialised memory, for which packets are checked.
AT_RANDOM = ("cfhd", "flashsv")
INTRA = ("cfhd",)  # of these
SHORTEST = 24  # frames between entries, as each stretch opens the file again


class _Entry(NamedTuple):
    """A key packet: its place in the file, its stamps, and the number of its frame, from 0."""

    place: int
    pts: int
    dts: int
    number: int


class Stretches:
    """The stretches of a stream with exact packets."""

    def __init__(self, decoder: Decoder) -> None:
        self._decoder, self._packets = decoder, decoder.packets
        self._count = len(self._packets.pts)
        self._entries = self._thinned()
        self._reach = self._reaches()
        self._is_judged = not self._fails_everywhere()

    def frames(self, start: int) -> Iterator[Numbered]:
        """Frames from index `start` on, rising; those that cannot be decoded leave gaps."""
        while start < self._count:
            if self._decoder.codec in _TOLD and self._is_judged:
                for item in self._sound(start, self._count, "strict", []):
                    start = item[0] + 1
                    yield item
                if start >= self._count:
                    return
            end = self._end(start)
            for item in self._alone(start, end):
                yield item
            start = end

    def _fails_everywhere(self) -> bool:
        """Whether MPEG-2 never decodes strictly, because its pictures lack the last row of slices.

        Some encoders omit it if the height is cropped, and players ignore that.
        """
        if self._decoder.codec != "mpeg2video" or not self._entries:
            return False
        last = len(self._entries) - 1
        for at in sorted({0, last // 2, last}):
            found = self._decoder.decoded(self._entries[at], "strict", lambda packet: True)
            if next(found, None) is not None:
                return False
        return True

    def _alone(self, start: int, end: int) -> Iterator[Numbered]:
        """A stretch, or its rest, single-threaded: strictly up to damage, then past it."""
        errors: list[int] = []
        for item in self._sound(start, end, "strict", errors) if self._is_judged else ():
            start = item[0] + 1
            yield copied(item)
        if start >= end:
            return
        # Failures before the stretch's key packet are in the lead-in, not part of it.
        own = self._own(start)
        lead = self._entries[own].place if own >= 0 else 0
        damaged = next((place for place in errors if place >= lead), len(self._packets.order) + 1)
        last, before = -1, None
        for frame in self._decoder.decoded(self._entry(start), "lenient"):
            index = self._packets.index_of(frame.pts)
            if index is None or index <= last:
                continue
            for item in self._with_repeats(last, min(index, end), before):
                if item[0] >= start:
                    yield copied(item)
            if index >= end:
                return
            is_checked, codec = self._packets.broken is not None, self._decoder.codec
            # Where broken packets are kept from an intra decoder, what follows them is whole.
            follows = self._place(index) >= damaged and not (is_checked and codec in INTRA)
            is_damaged = bool(frame.is_corrupt) or follows
            if is_damaged and codec in AT_RANDOM and not is_checked:
                continue  # left out, and so reported as missing
            last, before = index, (index, frame, is_damaged)
            if index >= start:
                yield copied(before)
        for item in self._with_repeats(last, end, before):
            if item[0] >= start:
                yield copied(item)

    def _sound(self, start: int, end: int, way: Way, errors: list[int]) -> Iterator[Numbered]:
        """Frames from `start` to before `end`, or up to the first damage.

        A frame is held back until all frames that it may depend on have arrived, as these may be
        shown later. `errors` receives the place of the packet that failed.
        """
        entry = self._entry(start)
        first = entry.number if entry is not None else 0
        held: deque[Numbered] = deque()
        last: Numbered | None = None

        def on_error(packet: Any) -> bool:
            behind = len(self._packets.order)
            pts = None if packet is None else packet.pts
            errors.append(behind if pts is None else self._packets.order.get(pts, (behind, 0))[0])
            return True

        def released(seen: int) -> Iterator[Numbered]:
            while held and self._reach[held[0][0]] <= seen:
                if start <= held[0][0] < end:
                    yield held[0]
                held.popleft()

        def is_sign(after: int, index: int) -> bool:
            return any(self._packets.pts[i] not in self._packets.repeats
                       for i in range(after + 1, index))  # fmt: skip

        for frame in self._decoder.decoded(entry, way, on_error):
            index = self._packets.index_of(frame.pts)
            if index is None or index < first:
                continue
            after = last[0] if last is not None else first - 1
            if frame.is_corrupt or index <= after or is_sign(after, index):
                return
            held.extend(self._with_repeats(after, index, last))
            last = index, frame, False
            held.append(last)
            yield from released(index)
            if index >= end and not (held and held[0][0] < end):
                return
        after = last[0] if last is not None else first - 1
        if not errors and not is_sign(after, self._count):
            held.extend(self._with_repeats(after, self._count, last))
            yield from released(self._count)

    def _with_repeats(self, after: int, until: int, last: Numbered | None) -> Iterator[Numbered]:
        """The frame `after` repeated for the frames after it that have no packet."""
        for index in range(after + 1, until) if last is not None and self._packets.repeats else ():
            if self._packets.pts[index] not in self._packets.repeats:
                return
            assert last is not None
            yield index, last[1], last[2]

    # ---- where decoding starts

    def _thinned(self) -> list[_Entry]:
        found: list[_Entry] = []
        for place, pts, dts in self._packets.keys:
            index = self._packets.index_of(pts)
            if index is not None and index >= (found[-1].number + SHORTEST if found else 0):
                found.append(_Entry(place, pts, dts, index))
        return found

    def _own(self, index: int) -> int:
        """The last entry before a frame both in file order and in presentation order; -1 for none.

        A frame shown before its key packet may refer to the group before.
        """
        while index > 0 and self._packets.pts[index] in self._packets.repeats:
            index -= 1
        at = bisect_right(self._entries, index, key=lambda entry: entry.number) - 1
        while at >= 0 and self._entries[at].place > self._place(index):
            at -= 1
        return at

    def _entry(self, index: int) -> _Entry | None:
        """Where decoding must start for a frame to be complete; None for the start of the file.

        For H.264 one entry earlier, as its key packets may be points of gradual recovery.
        """
        at = self._own(index) - (self._decoder.codec == "h264")
        return self._entries[at] if at >= 0 and self._entries[at].place > 0 else None

    def _end(self, start: int) -> int:
        """The index after the stretch that contains `start`."""
        own = self._own(start)
        after = bisect_right(self._entries, start, key=lambda entry: entry.number)
        for entry in self._entries[after:]:
            if self._own(entry.number) != own:
                return entry.number
        return self._count

    def _place(self, index: int) -> int:
        return self._packets.order.get(self._packets.pts[index], (-1, 0))[0]

    def _reaches(self) -> list[int]:
        """For each frame, the last one in presentation order of those before it in the file."""
        reach = list(range(self._count))
        own = [index for index in reach if self._packets.pts[index] not in self._packets.repeats]
        by_place = sorted(own, key=self._place)
        for index, furthest in zip(by_place, accumulate(by_place, max), strict=True):
            reach[index] = furthest
        return reach


def numbered(decoder: Decoder, start: int) -> Iterator[Numbered]:
    """Decoded frames with their indices, rising, from `start` on.

    If stamps are unusable, frames are counted from the start.
    """
    if decoder.packets.is_exact:
        yield from Stretches(decoder).frames(start)
        return
    for n, frame in enumerate(decoder.decoded(None, "lenient")):
        if n >= start:
            is_damaged = bool(frame.is_corrupt) or n in decoder.losses.damaged
            yield copied((n, frame, is_damaged))


def copied(item: Numbered) -> Numbered:
    """A copy of the frame in new memory.

    A decoder reuses returned buffers, and leaves old content where it cannot decode; so which
    buffer it gets must not depend on how long its frames are used.
    """
    index, frame, is_damaged = item
    graph = av.filter.Graph()
    source = graph.add_buffer(
        width=frame.width, height=frame.height, format=frame.format, time_base=Fraction(1)
    )
    copy, sink = graph.add("copy"), graph.add("buffersink")
    source.link_to(copy)
    copy.link_to(sink)
    graph.configure()
    graph.vpush(frame)
    return index, graph.vpull(), is_damaged
