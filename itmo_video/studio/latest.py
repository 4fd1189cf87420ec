"""One worker that keeps only the newest request of each lane, so that clicks never pile up."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import Any, TypeVar

from itmo_video.studio.session import StaleError

T = TypeVar("T")
Stale = Callable[[], bool]


class Latest:
    """Runs work in its own thread, one item at a time; `lanes` are in order of priority.

    A request overtaken by a newer one in its lane ends with StaleError, whether waiting or running:
    running work is given a function that reports it. At most one request per lane waits.
    """

    def __init__(self, lanes: Sequence[str]) -> None:
        self._lanes = tuple(lanes)
        self._waiting: dict[str, tuple[Callable[[Stale], Any], Future[Any]]] = {}
        self._newest = dict.fromkeys(lanes, 0)
        self._some = threading.Condition()
        self._closed = False
        self._thread = threading.Thread(target=self._work, name="studio-render", daemon=True)
        self._thread.start()

    def submit(self, lane: str, work: Callable[[Stale], T]) -> Future[T]:
        """Schedule `work`; raises KeyError for an unknown lane."""
        future: Future[T] = Future()
        with self._some:
            self._newest[lane] += 1
            overtaken = self._waiting.pop(lane, None)
            if self._closed:
                overtaken = work, future
            else:
                self._waiting[lane] = work, future
            self._some.notify()
        if overtaken is not None:
            _drop(overtaken[1])
        return future

    def close(self) -> None:
        """Mark the running work as stale, drop waiting requests, and end the thread."""
        with self._some:
            self._closed = True
            dropped = list(self._waiting.values())
            self._waiting.clear()
            self._some.notify()
        for _, future in dropped:
            _drop(future)
        self._thread.join()

    def _next(self) -> tuple[str, int, Callable[[Stale], Any], Future[Any]] | None:
        with self._some:
            while not self._waiting and not self._closed:
                self._some.wait()
            for lane in self._lanes:
                if lane in self._waiting:
                    work, future = self._waiting.pop(lane)
                    return lane, self._newest[lane], work, future
        return None

    def _work(self) -> None:
        while (found := self._next()) is not None:
            lane, serial, work, future = found
            if not future.set_running_or_notify_cancel():
                continue  # the caller has gone

            def stale(lane: str = lane, serial: int = serial) -> bool:
                return self._closed or self._newest[lane] != serial

            try:
                result = work(stale)
            except BaseException as error:  # any error goes to the caller
                future.set_exception(error)
            else:
                future.set_result(result)


def _drop(future: Future[Any]) -> None:
    if future.set_running_or_notify_cancel():
        future.set_exception(StaleError())
