"""Runs the command under a memory limit, at which libraries end the process instead of raising."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterable

from itmo_video.memory_limit import memory_limit

_ENDED = (signal.SIGABRT, signal.SIGSEGV, signal.SIGBUS)
_PASSED_ON = (signal.SIGTERM, signal.SIGINT)


def out_of_memory() -> int:
    """Report that memory ran out, and the limit; returns the exit code."""
    limit = memory_limit()
    cause = (
        "also check for a memory limit (ulimit -v)"
        if limit is None
        else f"or raise the limit, which is {limit / 1e6:.0f} MB (ulimit -v, ulimit -d)"
    )
    print(
        "itmo-video: not enough memory; finished frames are intact\n"
        f"Use fewer --jobs or a smaller --map-width; {cause}.",
        file=sys.stderr,
    )
    return 1


def guarded(main: Callable[[], int]) -> int:
    """The exit code of `main`; under a limit it runs in a child process.

    This makes it possible to report that a library ended it: OpenBLAS exits with 1, glibc with 127,
    C++ aborts.
    """
    if memory_limit() is None or not hasattr(signal, "sigwaitinfo"):
        return main()
    watched = {signal.SIGCHLD, *_PASSED_ON}
    before = signal.pthread_sigmask(signal.SIG_BLOCK, watched)
    reads, writes = os.pipe()
    child = os.fork()
    if child == 0:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        try:
            return main()
        finally:
            os.write(writes, b".")
    os.set_blocking(reads, False)
    code = os.waitstatus_to_exitcode(_watched(child, watched))
    try:
        has_returned = bool(os.read(reads, 1))
    except BlockingIOError:
        has_returned = False
    if -code in _ENDED or (code >= 0 and not has_returned):
        return out_of_memory()
    return code if code >= 0 else 128 - code


def _watched(child: int, watched: Iterable[int]) -> int:
    """The child's status once it ends; until then, signals are passed on to it."""
    while True:
        told = signal.sigwaitinfo(watched)
        if told.si_signo != signal.SIGCHLD:
            if told.si_pid:  # a terminal, which has none, signals the child as well
                os.kill(child, told.si_signo)
            continue
        done, status = os.waitpid(child, os.WNOHANG)
        if done == child and not os.WIFSTOPPED(status):
            return status
