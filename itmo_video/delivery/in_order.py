"""Passing on frames from several threads in presentation order with bounded memory."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import Generic, TypeVar

T = TypeVar("T")


class Closed(Exception):  # noqa: N818 - not an error: the reader has left
    """The reader has left."""


class InOrder(Generic[T]):
    """A reorder buffer: `plan` announces the order, `put` adds a frame, iteration takes them.

    A thread that is more than `capacity` frames ahead of the reader waits in `put`. The thread with
    the next frame never waits, so there is always progress.
    """

    def __init__(self, capacity: int) -> None:
        self._capacity = capacity
        self._changed = threading.Condition()
        self._expected: deque[int] = deque()
        self._ranks: dict[int, int] = {}
        self._ready: dict[int, T] = {}
        self._planned = self._taken = 0
        self._finished = self._closed = False
        self._error: BaseException | None = None

    def plan(self, indices: Sequence[int]) -> None:
        """Announce the next frames, before any of them is put."""
        with self._changed:
            for index in indices:
                self._ranks[index] = self._planned
                self._planned += 1
                self._expected.append(index)

    def put(self, index: int, item: T) -> None:
        """Add a frame; waits while too far ahead, raises Closed once the reader has left."""
        with self._changed:
            rank = self._ranks[index]
            self._changed.wait_for(lambda: self._closed or rank - self._taken < self._capacity)
            if self._closed:
                raise Closed
            self._ready[index] = item
            self._changed.notify_all()

    def finish(self, error: BaseException | None = None) -> None:
        """Mark the end; the reader gets `error`, if any, after the frames in order."""
        with self._changed:
            self._finished, self._error = True, error
            self._changed.notify_all()

    def close(self) -> None:
        """Mark the reader as gone: threads waiting in `put` get Closed."""
        with self._changed:
            self._closed = True
            self._ready.clear()
            self._changed.notify_all()

    def __iter__(self) -> Iterator[T]:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._finished or self._next_is_ready())
                if not self._next_is_ready():
                    if self._error is not None:
                        raise self._error
                    return
                index = self._expected.popleft()
                del self._ranks[index]
                item = self._ready.pop(index)
                self._taken += 1
                self._changed.notify_all()
            yield item

    def _next_is_ready(self) -> bool:
        return bool(self._expected) and self._expected[0] in self._ready


def run_in_order(
    make: Callable[[InOrder[T]], None], capacity: int, on_leave: Callable[[], None] = lambda: None
) -> Iterator[T]:
    """Run `make` in its own thread and yield in order what it plans and puts; raises its errors.

    If the reader stops early, `make` gets Closed from `put` and is waited for; `on_leave` is called
    first, to end anything else it may wait for.
    """
    buffer: InOrder[T] = InOrder(capacity)

    def run() -> None:
        try:
            make(buffer)
        except Closed:
            buffer.finish()
        except BaseException as error:
            buffer.finish(error)
        else:
            buffer.finish()

    thread = threading.Thread(target=run, name="in-order")
    thread.start()
    try:
        yield from buffer
    finally:
        buffer.close()
        on_leave()
        thread.join()
