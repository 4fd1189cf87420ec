"""The studio's caches: bounded in bytes, least recently used entries go first."""

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
    """A cache of values by key, at most `limit_bytes` in all; thread-safe."""

    def __init__(self, limit_bytes: int) -> None:
        self._limit, self._held = limit_bytes, 0
        self._values: OrderedDict[Hashable, tuple[V, int]] = OrderedDict()
        self._lock = Lock()

    @property
    def held_bytes(self) -> int:
        """The size of all values held."""
        return self._held

    def get(self, key: Hashable) -> V | None:
        """The value, marked as the most recently used."""
        with self._lock:
            if key not in self._values:
                return None
            self._values.move_to_end(key)
            return self._values[key][0]

    def recall(self, key: Hashable, make: Callable[[], V], size_of: Callable[[V], int]) -> V:
        """The value, computed (outside the lock) if it is not held."""
        held = self.get(key)
        if held is None:
            held = make()
            self.put(key, held, size_of(held))
        return held

    def put(self, key: Hashable, value: V, size_bytes: int) -> None:
        """Hold a value, dropping others for it; a value larger than the limit is not held."""
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
    """A clip with a cache of decoded frames; for one thread.

    A frame depends on the source alone, so a held frame equals what decoding would give.
    """

    def __init__(self, clip: Clip, limit_bytes: int) -> None:
        self._clip, self.info = clip, clip.info
        self._frames = Memory[Frame](limit_bytes)
        # The last decoder used, and the index of the frame it gives next, so that playing on
        # does not seek at every frame.
        self._parked: tuple[Iterator[Frame], int] | None = None

    def frames(self, start: int = 0) -> Iterator[Frame]:
        """Yield the frames from `start` on, decoding only those not held."""
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
        """The presentation time of the frame at `index`."""
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
