"""Writing Y4M: uncompressed films for pipes, to standard output, a FIFO or a file.

A stream header, then "FRAME" and the planes of each frame; it has no tags other than range and
chroma (mjpegtools' Y4M; X tags as in FFmpeg).
"""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from itmo_video.delivery.choices import Chroma
from itmo_video.delivery.hdr import Light
from itmo_video.delivery.ycbcr import Codes10
from itmo_video.errors import OutputError, UsageError
from itmo_video.output.atomic import RUN_AGAIN, output_error, temp_path
from itmo_video.output.gate import Gate

STANDARD_OUTPUT = "-"
_PIPE_BYTES = 1 << 20


class ReaderLeftError(Exception):
    """The reader has closed the pipe."""


@dataclass(frozen=True)
class Y4mSpec:
    """The header of a Y4M stream: size in pixels, limited range, chroma sited left."""

    width: int
    height: int
    frame_rate: Fraction
    pixel_aspect: Fraction
    chroma: Chroma = "420"
    bit_depth: int = 10

    def header(self) -> bytes:
        """The stream's first line."""
        rate, aspect = self.frame_rate, self.pixel_aspect
        if self.bit_depth == 8:
            plain = f"{self.chroma} XYSCSS={self.chroma}"
            kind = "420mpeg2 XYSCSS=420MPEG2" if self.chroma == "420" else plain
        else:
            kind = f"{self.chroma}p{self.bit_depth} XYSCSS={self.chroma}P{self.bit_depth}"
        return (
            f"YUV4MPEG2 W{self.width} H{self.height} F{rate.numerator}:{rate.denominator} Ip "
            f"A{aspect.numerator}:{aspect.denominator} C{kind} XCOLORRANGE=LIMITED\n"
        ).encode("ascii")

    def frame(self, planes: tuple[Codes10, ...]) -> list[memoryview]:
        """A frame's bytes, in pieces: of the planes themselves where they can be."""
        kind = np.uint8 if self.bit_depth == 8 else np.dtype("<u2")
        laid_out: list[Any] = [np.ascontiguousarray(plane, kind) for plane in planes]
        return [memoryview(b"FRAME\n"), *(memoryview(plane).cast("B") for plane in laid_out)]


class Y4mWriter:
    """Writes frames to a pipe immediately, or to a file that appears when finished."""

    notices: tuple[str, ...] = ()

    def __init__(self, path: Path, spec: Y4mSpec, gate: Gate | None = None) -> None:
        self.path, self.bytes_written = path, 0
        self._spec, self._gate = spec, gate
        self._temp = temp_path(path.absolute()) if gate is not None else None
        try:
            where = _descriptor(path) if self._temp is None else self._temp
            self._file = open(where, "wb", 0)  # noqa: SIM115 - `close` closes it
        except OSError as error:
            raise output_error(error, path, RUN_AGAIN) from error
        if gate is None:
            with suppress(ImportError, OSError, AttributeError):
                import fcntl

                fcntl.fcntl(self._file.fileno(), fcntl.F_SETPIPE_SZ, _PIPE_BYTES)

    def write(
        self,
        planes: tuple[Codes10, ...],
        time_s: Fraction,
        duration_s: Fraction | None = None,
        message: bytes | None = None,
    ) -> None:
        """Write one frame; raises ReaderLeftError if the reader has closed the pipe.

        The header precedes the first frame. Y4M cannot hold times and messages.
        """
        if not self.bytes_written:
            self._put(memoryview(self._spec.header()))
        for piece in self._spec.frame(planes):
            self._put(piece)

    def finish(self, light: Light | None) -> None:
        """Complete the file; does nothing for a pipe."""
        self._file.close()
        if self._gate is not None and self._temp is not None:
            self._gate.put(self._temp)

    def close(self) -> None:
        """Close, and remove a file that was not finished."""
        with suppress(OSError):
            self._file.close()
        if self._temp is not None:
            with suppress(OSError):
                self._temp.unlink()

    def _put(self, data: memoryview) -> None:
        left = data
        try:
            while left:
                left = left[self._file.write(left) :]
        except BrokenPipeError as error:
            raise ReaderLeftError from error
        except OSError as error:
            raise output_error(error, self.path, RUN_AGAIN) from error
        self.bytes_written += len(data)


def _descriptor(path: Path) -> int:
    if os.fspath(path) != STANDARD_OUTPUT:
        return os.open(path, os.O_WRONLY)
    # The command line replaces closed streams by the null device (cli.streams); if a shell
    # opened it, its name is <stdout>.
    if sys.stdout is None or getattr(sys.stdout, "name", None) == os.devnull:
        raise OutputError(
            "standard output is closed", remedy="Pipe it: ... - | x265 --y4m - -o film.hevc"
        )
    if sys.stdout.isatty():
        raise UsageError(
            "standard output is a terminal", remedy="Pipe it: ... - | x265 --y4m - -o film.hevc"
        )
    try:
        sys.stdout.flush()
        return os.dup(sys.stdout.fileno())
    except OSError as error:
        raise OutputError(
            f"cannot be written ({error.strerror})",
            where="standard output",
            remedy="Pipe it: ... - | x265 --y4m - -o film.hevc",
        ) from error
