"""Copying a source's sound, chapters and time base to a film."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

from itmo_video.source.packets import open_container, open_video
from itmo_video.source.stamp_jumps import BROADCAST, Jumps
from itmo_video.source.streams import choose_video

# QuickTime calls a track's title its name.
_KEPT_TAGS = {"language": "language", "name": "title", "title": "title", "comment": "comment"}
_KEPT_FLAGS = 0x1FF  # default, dub, original, comment, lyrics, karaoke, forced, impaired


def source_time_base(path: Path, max_pixels: int, number: int | None = None) -> Fraction:
    """The time base of a film's video stream in seconds; raises InputError."""
    with open_video(path, max_pixels, number) as (_, stream):
        return Fraction(stream.time_base or Fraction(1, 90000))


class Sound:
    """The sound tracks of an open source, added to a film; `packets` yields them in order.

    Tracks with a codec that FFmpeg does not support are left out, with a notice. `first_s` is the
    start of the first sound in source time.
    """

    def __init__(self, source: Path, film: Any, max_pixels: int, stream: int | None = None) -> None:
        self._box: Any = open_container(source, max_pixels)
        self.notices: list[str] = []
        self._targets: dict[int, Any] = {}
        audio = list(self._box.streams.audio)
        for track in audio:
            if track.codec_context is None:
                self.notices.append(
                    f"sound track {track.index} is left out: FFmpeg does not support its codec"
                )
                continue
            target = film.add_stream_from_template(track)
            for name, kept in _KEPT_TAGS.items():
                if track.metadata.get(name):
                    target.metadata[kept] = track.metadata[name]
            target.disposition = type(track.disposition)(int(track.disposition) & _KEPT_FLAGS)
            self._targets[track.index] = target
        self._streams = [track for track in audio if track.index in self._targets]
        video, _ = choose_video(self._box, stream, str(source))
        self._is_joined = bool(self._streams) and _is_joined(source, video, max_pixels)
        started = [track for track in self._streams if track.start_time is not None]
        starts = [s.start_time * Fraction(s.time_base) for s in started]
        zero = (video.start_time or 0) * Fraction(video.time_base)
        self._zero_s = zero if self._is_joined else Fraction(0)
        self.first_s = min(starts, default=zero) - self._zero_s

    def chapters(self) -> list[Any]:
        """The source's chapters."""
        return list(self._box.chapters())

    def packets(self) -> Iterator[tuple[Any, Fraction]]:
        """Each packet, assigned to the film's stream, with its start in source time."""
        if not self._streams:
            return
        joins = {s.index: _Join(s) for s in self._streams}
        for packet in self._box.demux(*self._streams):
            if packet.pts is None or packet.size == 0:
                continue
            base, index = Fraction(packet.time_base), packet.stream.index
            if self._is_joined:
                shift = joins[index].shift(packet) - round(self._zero_s / base)
                packet.pts += shift
                if packet.dts is not None:
                    packet.dts += shift
            packet.stream = self._targets[index]
            yield packet, packet.pts * base

    def close(self) -> None:
        """Close the source."""
        self._box.close()


class _Join:
    """Makes the time stamps of joined captures continuous, in ticks of one track."""

    def __init__(self, stream: Any) -> None:
        self._jumps, self._shift, self._end = Jumps(stream), 0, 0

    def shift(self, packet: Any) -> int:
        """The offset to add to this packet's stamps so that it follows the previous one."""
        if self._jumps.see(packet.pts):
            self._shift = self._end - packet.pts
        self._end = packet.pts + self._shift + (packet.duration or 0)
        return self._shift


def _is_joined(source: Path, video: Any, max_pixels: int) -> bool:
    """Whether the video stamps of a broadcast file jump, so that its frames are counted."""
    if str(video.container.format.name) not in BROADCAST:
        return False
    jumps = Jumps(video)
    box: Any = open_container(source, max_pixels)
    try:
        for packet in box.demux(box.streams[video.index]):
            if packet.size and jumps.see(packet.dts if packet.dts is not None else packet.pts):
                return True
    finally:
        box.close()
    return False
