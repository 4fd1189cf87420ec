"""Opening SVT-AV1 without side effects: silent, and with threads of normal priority."""

from __future__ import annotations

import ctypes
import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

_CAP_SYS_NICE = 23  # linux/capability.h
_CAPABILITY_VERSION = 0x20080522  # _LINUX_CAPABILITY_VERSION_3: two words of 32 bits each


class _Header(ctypes.Structure):
    _fields_ = [("version", ctypes.c_uint32), ("pid", ctypes.c_int)]


class _Word(ctypes.Structure):
    _fields_ = [(name, ctypes.c_uint32) for name in ("effective", "permitted", "inheritable")]


_opening = threading.Lock()


@contextmanager
def svt_as_guest() -> Iterator[None]:
    """A context for opening an encoder, in the thread that opens it.

    On start, SVT-AV1 reads its log level from the environment. And if permitted (root,
    CAP_SYS_NICE) it gives its threads *and its caller's* the highest real-time priority
    (SCHED_FIFO 99), with which a few encoders at once freeze a machine.
    """
    with _opening, _silent(), _without_real_time():
        yield


@contextmanager
def _silent() -> Iterator[None]:
    if "SVT_LOG" in os.environ:
        yield
        return
    os.environ["SVT_LOG"] = "0"
    try:
        yield
    finally:
        del os.environ["SVT_LOG"]


@contextmanager
def _without_real_time() -> Iterator[None]:
    """Linux capabilities are per thread; threads created meanwhile inherit the reduced set."""
    before = _effective() if sys.platform == "linux" else None
    if before is None or not before & (1 << _CAP_SYS_NICE):
        yield
        return
    _set_effective(before & ~(1 << _CAP_SYS_NICE))
    try:
        yield
    finally:
        _set_effective(before)


def _call(name: str, words: ctypes.Array[_Word]) -> bool:
    call = getattr(ctypes.CDLL(None), name, None)  # musl and glibc have both
    return call is not None and call(ctypes.byref(_Header(_CAPABILITY_VERSION, 0)), words) == 0


def _effective() -> int | None:
    """The first 32 effective capabilities of this thread; None if not available."""
    words = (_Word * 2)()
    return int(words[0].effective) if _call("capget", words) else None


def _set_effective(low_word: int) -> None:
    words = (_Word * 2)()
    if _call("capget", words):
        words[0].effective = low_word
        _call("capset", words)
