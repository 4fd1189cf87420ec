"""One worker that keeps only a page's newest request of each lane, so that clicks never pile up."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from functools import partial
from typing import Any, TypeVar

from itmo_video.studio.session import StaleError

T = TypeVar("T")
Stale = Callable[[], bool]
_MOST_WAITING = 64


class _Request:
    """Work that a caller waits for; `is_stale` once it is overtaken."""

    def __init__(self, lane: str, page: str, work: Callable[[Stale], Any]) -> None:
        self.lane, self.page, self.work = lane, page, work
        self.future: Future[Any] = Future()
        self.is_stale = False

    def drop(self) -> None:
        """Tell the caller that the work will not be done."""
        if self.future.set_running_or_notify_cancel():
            self.future.set_exception(StaleError())


class Latest:
    """Runs work in its own thread, one item at a time; `lanes` are in order of priority.

    A request overtaken by a newer one of its page and lane ends with StaleError, whether waiting or
    running: running work is given a function that reports it. At most one request per page and
    lane waits, and the pages take turns; beyond 64 in all the oldest is dropped.
    """

    def __init__(self, lanes: Sequence[str]) -> None:
        self._lanes = tuple(lanes)
        self._waiting: list[_Request] = []
        self._running: _Request | None = None
        self._some = threading.Condition()
        self._closed = False
        self._thread = threading.Thread(target=self._work, name="studio-render", daemon=True)
        self._thread.start()

    def submit(self, lane: str, work: Callable[[Stale], T], page: str = "") -> Future[T]:
        """Schedule `work` for one of the pages; raises ValueError for an unknown lane."""
        self._lanes.index(lane)
        request = _Request(lane, page, work)
        dropped: list[_Request] = []
        with self._some:
            for other in (*self._waiting, *((self._running,) if self._running else ())):
                if (other.lane, other.page) == (lane, page):
                    other.is_stale = True
            self._waiting.append(request)
            while self._closed or len(self._waiting) > _MOST_WAITING:
                dropped.append(self._waiting.pop(0))
                if not self._waiting:
                    break
            dropped += [other for other in self._waiting if other.is_stale]
            self._waiting = [other for other in self._waiting if not other.is_stale]
            self._some.notify()
        for other in dropped:
            other.drop()
        return request.future

    def close(self) -> None:
        """Mark the running work as stale, drop waiting requests, and end the thread."""
        with self._some:
            self._closed = True
            dropped, self._waiting = self._waiting, []
            self._some.notify()
        for request in dropped:
            request.drop()
        self._thread.join()

    def _next(self) -> _Request | None:
        with self._some:
            while not self._waiting and not self._closed:
                self._some.wait()
            if not self._waiting:
                return None
            found = min(self._waiting, key=lambda request: self._lanes.index(request.lane))
            self._waiting.remove(found)
            self._running = found
            return found

    def _work(self) -> None:
        while (request := self._next()) is not None:
            future = request.future
            if not future.set_running_or_notify_cancel():
                continue  # the caller has gone
            try:
                result = request.work(partial(self._is_stale, request))
            except BaseException as error:  # any error goes to the caller
                future.set_exception(error)
            else:
                future.set_result(result)

    def _is_stale(self, request: _Request) -> bool:
        return self._closed or request.is_stale
