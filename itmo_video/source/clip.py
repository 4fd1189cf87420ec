"""The interface of an open source, and a source resampled to another frame rate."""

from __future__ import annotations

import dataclasses
from bisect import bisect_right
from collections.abc import Iterator, Mapping
from fractions import Fraction
from math import ceil
from types import MappingProxyType

from itmo_video.errors import UsageError
from itmo_video.model import ClipInfo, Frame
from itmo_video.words import counted

_ROUNDING_S = Fraction(1, 1000)  # Matroska rounds time stamps to milliseconds


class Clip:
    """An open source: `info` is its metadata, `frames` reads it. Close it, or use `with`.

    >>> from itmo_video import open_clip
    >>> with open_clip("clip.mkv") as clip:
    ...     [(frame.index, str(frame.time_s)) for frame in clip.frames(1)]
    [(1, '21/500'), (2, '83/1000')]
    """

    info: ClipInfo
    faults: Mapping[int, str] = MappingProxyType({})  # by index: why a frame cannot be decoded
    disk_fault: str | None = None  # where the disk failed, of a clip that ends there
    reads_once = False  # a pipe: `frames` works once, from 0 on

    def __repr__(self) -> str:
        width, height = self.info.display_size
        count = counted(self.info.frames, "frame")
        return f"<{type(self).__name__} {self.info.path!r}: {count}, {width}x{height}>"

    def frames(self, start: int = 0) -> Iterator[Frame]:
        """Yield the frames from index `start` on, in presentation order, the same whatever `start`.

        Frames that cannot be decoded are left out, so indices may have gaps. Raises
        DamagedInputError at the first frame whose size or format differs from the first frame's.
        Independent iterators may run in parallel, also in threads.
        """
        raise NotImplementedError

    def time_s(self, index: int) -> Fraction:
        """The presentation time of the frame at `index` in seconds, as stored in the file."""
        raise NotImplementedError

    @property
    def last_length_s(self) -> Fraction:
        """The duration of the last frame in seconds; at a variable rate, its own."""
        info, usual = self.info, 1 / self.info.frame_rate
        if not info.is_vfr or info.frames < 1:
            return usual
        rest = self.time_s(0) + info.duration_s - self.time_s(info.frames - 1)
        return rest if rest > 0 else usual

    def close(self) -> None:
        """Release the source; files still being read stay open until the reading ends."""

    def __enter__(self) -> Clip:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()


def first_number(info: ClipInfo, asked: int | None) -> int:
    """The number of a clip's first frame in file names: its own, `asked`, or 1.

    Raises UsageError if `asked` differs from the first number of an image sequence.
    """
    own = info.first_number
    if asked is None:
        return 1 if own is None else own
    if own not in (None, asked) and info.container == "image sequence":
        raise UsageError(
            f"an image sequence keeps its own numbers, which start at {own}",
            where=info.path,
            remedy="Omit --start-number.",
        )
    return asked


class Resampled(Clip):
    """A clip at a constant frame rate: each frame is the source's frame shown at that time.

    All numbers count resampled frames, from the source's first time stamp on. Frames that cannot be
    decoded leave gaps as in the source.
    """

    def __init__(self, clip: Clip, rate: Fraction) -> None:
        self._clip = clip
        times = [clip.time_s(i) for i in range(clip.info.frames)]
        self._begin = times[0]
        end = times[-1] + clip.last_length_s
        count = max(1, ceil((end - self._begin) * rate))
        self._rate = rate
        self._sources = [
            bisect_right(times, self.time_s(m) + _ROUNDING_S) - 1 for m in range(count)
        ]
        self.info = dataclasses.replace(
            clip.info,
            frames=count,
            frame_rate=rate,
            duration_s=count / rate,
            is_vfr=False,
            timecode=None,
            frames_declared=None,
            notices=(*clip.info.notices, f"resampled to {rate} fps"),
        )

    def time_s(self, index: int) -> Fraction:
        """The presentation time of the resampled frame at `index` in seconds."""
        return self._begin + index / self._rate

    def frames(self, start: int = 0) -> Iterator[Frame]:
        """Yield resampled frames; a source frame may be repeated or dropped."""
        position = start
        if start >= len(self._sources):
            return
        for frame in self._clip.frames(self._sources[start]):
            while position < len(self._sources) and self._sources[position] < frame.index:
                position += 1
            while position < len(self._sources) and self._sources[position] == frame.index:
                yield dataclasses.replace(frame, index=position, time_s=self.time_s(position))
                position += 1
            if position >= len(self._sources):
                return

    def close(self) -> None:
        """Release the source."""
        self._clip.close()
