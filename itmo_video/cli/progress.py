"""Progress of a conversion: JSON lines for machines, rate and time left for people."""

from __future__ import annotations

import json
import sys
import time
from typing import TextIO

from itmo_video.events import Event, Finished, FrameDone, Warned, as_json
from itmo_video.words import counted


class Progress:
    """Tells events: as JSON on standard output, else on standard error, the rate on terminals."""

    def __init__(self, *, as_json: bool, quiet: bool, stream: TextIO | None = None) -> None:
        self._as_json, self._quiet = as_json, quiet
        self._stream = stream or sys.stderr
        self._began = time.monotonic()
        self._on_terminal = self._stream.isatty()
        self._is_line_open = False
        self._lost: Exception | None = None

    def on_event(self, event: Event) -> None:
        """Tell one event."""
        if self._as_json:
            self._tell(json.dumps(as_json(event)))
        if self._quiet:
            return
        match event:
            case Warned(message):
                self.close()
                print(f"itmo-video: {message}", file=self._stream)
            case FrameDone(_, done, of) if self._on_terminal:
                self._line(done, of)
                if done == of:
                    self.close()
            case Finished():
                self._sum_up(event)

    def _tell(self, line: str) -> None:
        """A line on standard output; who reads no longer does not stop the work."""
        if self._lost is not None:
            return
        try:
            print(line, flush=True)
        except (OSError, ValueError) as error:
            self._lost = error

    def _sum_up(self, event: Finished) -> None:
        self.close()
        present = f", {event.present} there before" if event.present else ""
        print(
            f"itmo-video: {counted(event.written, 'frame')} made{present}, "
            f"{event.seconds:.1f} s, {event.bytes_written / 1e6:.1f} MB",
            file=self._stream,
        )

    def _line(self, done: int, total: int) -> None:
        elapsed = max(time.monotonic() - self._began, 1e-6)
        rate = done / elapsed
        of, left = f"/{total}", f", {(total - done) / rate:.0f} s left"
        if not total:  # of a pipe
            of = left = ""
        text = f"\r{done}{of} frames, {rate:.1f} fps{left} "
        print(text, end="", file=self._stream, flush=True)
        self._is_line_open = True

    def close(self) -> None:
        """End the line that stands on the terminal, so that others may write below it."""
        if self._is_line_open:
            print(file=self._stream)
        self._is_line_open = False
