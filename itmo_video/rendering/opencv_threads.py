"""Limits OpenCV to one thread while frames are rendered in ours, and restores it afterwards."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

import cv2

_lock = threading.Lock()
_users = 0
_threads_before = 1


@contextmanager
def single_opencv_thread() -> Iterator[None]:
    """Let OpenCV use the calling thread only, as our workers use all cores.

    The setting applies to the whole process, so the last user restores it.
    """
    global _users, _threads_before
    with _lock:
        if _users == 0:
            _threads_before = cv2.getNumThreads()
            cv2.setNumThreads(1)
        _users += 1
    try:
        yield
    finally:
        with _lock:
            _users -= 1
            if _users == 0:
                cv2.setNumThreads(_threads_before)
