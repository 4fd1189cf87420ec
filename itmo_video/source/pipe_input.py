"""The bytes of standard input or a FIFO, as they arrive."""

from __future__ import annotations

import os
import select
import sys
import threading
from contextlib import suppress

from itmo_video.errors import UsageError
from itmo_video.source.chroma_siting import Y4M_HEAD_BYTES

STANDARD_INPUT = "-"
BUFFER_BYTES = 1 << 20


class PipeInput:
    """Standard input or a FIFO, read as bytes arrive; `close` ends a waiting read, in any thread.

    `head` is its first bytes, which FFmpeg has read already.
    """

    def __init__(self, name: str) -> None:
        self.bytes_read, self.head = 0, b""
        self._changing, self._is_reading, self._is_closed = threading.Lock(), False, False
        if name == STANDARD_INPUT:
            if sys.stdin is None or sys.stdin.isatty():
                raise UsageError(
                    "standard input is a terminal, not a video stream",
                    remedy="Pipe one in: ffmpeg ... -f yuv4mpegpipe - | itmo-video convert - out/",
                )
            self._fd = os.dup(sys.stdin.fileno())
        else:
            self._fd = os.open(name, os.O_RDONLY)
        self._woken, self._wake = os.pipe()
        with suppress(ImportError, OSError, AttributeError):
            import fcntl

            fcntl.fcntl(self._fd, fcntl.F_SETPIPE_SZ, BUFFER_BYTES)  # fewer, larger reads

    def read(self, size: int = -1) -> bytes:
        """The bytes that are there, at most `size`; empty at the end, or once closed."""
        with self._changing:
            if self._is_closed:
                return b""
            self._is_reading = True
        try:
            ready, _, _ = select.select([self._fd, self._woken], [], [])
            if self._woken in ready:
                return b""
            data = os.read(self._fd, size if size > 0 else BUFFER_BYTES)
        finally:
            self._end_read()
        self.bytes_read += len(data)
        if len(self.head) < Y4M_HEAD_BYTES:
            self.head += data[: Y4M_HEAD_BYTES - len(self.head)]
        return data

    def close(self) -> None:
        """Stop reading, once a waiting read has ended; the writer then gets a broken pipe."""
        with self._changing:
            if self._is_closed:
                return
            self._is_closed = True
            if self._is_reading:
                os.write(self._wake, b"x")  # who reads closes, as another file may get the number
            else:
                self._release()

    def _end_read(self) -> None:
        with self._changing:
            self._is_reading = False
            if self._is_closed:
                self._release()

    def _release(self) -> None:
        for name in ("_fd", "_woken", "_wake"):  # as far as they were opened
            with suppress(OSError, KeyError):
                os.close(self.__dict__.pop(name))

    def __del__(self) -> None:
        with suppress(AttributeError):
            self.close()
