"""What the studio remembers: bounded in bytes, the longest unused goes first."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator
from fractions import Fraction
from threading import Lock
from typing import Generic, TypeVar

from itmo_video.model import Frame
from itmo_video.source.clip import Clip

V = TypeVar("V")


class Memory(Generic[V]):
    """Values by key, at most `limit_bytes` of them; thread-safe."""

    def __init__(self, limit_bytes: int) -> None:
        self._limit, self._held = limit_bytes, 0
        self._values: OrderedDict[Hashable, tuple[V, int]] = OrderedDict()
        self._lock = Lock()

    @property
    def held_bytes(self) -> int:
        """What the values that are held take."""
        return self._held

    def get(self, key: Hashable) -> V | None:
        """The value, which is then the last to go."""
        with self._lock:
            if key not in self._values:
                return None
            self._values.move_to_end(key)
            return self._values[key][0]

    def recall(self, key: Hashable, make: Callable[[], V], size_of: Callable[[V], int]) -> V:
        """The value, made where it is not held; it is made outside of the lock."""
        held = self.get(key)
        if held is None:
            held = make()
            self.put(key, held, size_of(held))
        return held

    def put(self, key: Hashable, value: V, size_bytes: int) -> None:
        """Hold a value; others go for it. One that is too large by itself is not held."""
        with self._lock:
            if key in self._values:
                self._held -= self._values.pop(key)[1]
            if size_bytes > self._limit:
                return
            self._values[key] = (value, size_bytes)
            self._held += size_bytes
            while self._held > self._limit:
                self._held -= self._values.popitem(last=False)[1][1]


class RememberedClip(Clip):
    """A clip whose decoded frames are held for a while; for one thread.

    A frame depends on the source alone, so one that is held is the one that decoding gives.
    """

    def __init__(self, clip: Clip, limit_bytes: int) -> None:
        self._clip, self.info = clip, clip.info
        self._frames = Memory[Frame](limit_bytes)
        # The decoder that was left last, and the index that it gives next: playing on is not
        # seeking anew at every frame.
        self._parked: tuple[Iterator[Frame], int] | None = None

    def frames(self, start: int = 0) -> Iterator[Frame]:
        """Yield the frames from `start` on, decoding only those that are not held."""
        index = start
        decoder: Iterator[Frame] | None = None
        position = -1
        try:
            while index < self.info.frames:
                frame = self._frames.get(index)
                if frame is None:
                    if decoder is None or position != index:
                        self._leave(decoder, position)
                        decoder, position = self._decoder(index), index
                    frame = next(decoder, None)
                    if frame is None:
                        decoder = None
                        return
                    position = frame.index + 1
                    self._frames.put(frame.index, frame, sum(p.nbytes for p in frame.planes))
                yield frame
                index = frame.index + 1
        finally:
            self._leave(decoder, position)

    def time_s(self, index: int) -> Fraction:
        """Presentation time of the frame `index`."""
        return self._clip.time_s(index)

    def close(self) -> None:
        """Release the source."""
        if self._parked is not None:
            _close(self._parked[0])
        self._parked = None
        self._clip.close()

    def _decoder(self, index: int) -> Iterator[Frame]:
        if self._parked is not None and self._parked[1] == index:
            decoder, self._parked = self._parked[0], None
            return decoder
        return self._clip.frames(index)

    def _leave(self, decoder: Iterator[Frame] | None, position: int) -> None:
        if decoder is None:
            return
        if self._parked is not None:
            _close(self._parked[0])
        self._parked = (decoder, position)


def _close(decoder: Iterator[Frame]) -> None:
    close = getattr(decoder, "close", None)  # of a generator
    if close is not None:
        close()
