"""Progress of a conversion: JSON lines for machines, rate and time left for people."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Mapping
from typing import Any, TextIO


class Progress:
    """Tells events: as JSON on standard output, else on standard error, the rate on terminals."""

    def __init__(self, *, as_json: bool, quiet: bool, stream: TextIO | None = None) -> None:
        self._as_json, self._quiet = as_json, quiet
        self._stream = stream or sys.stderr
        self._began = time.monotonic()
        self._on_terminal = self._stream.isatty()

    def on_event(self, event: Mapping[str, Any]) -> None:
        """Tell one event."""
        if self._as_json:
            print(json.dumps(event), flush=True)
        if self._quiet:
            return
        kind = event["event"]
        if kind == "warning":
            print(f"itmo-video: {event['message']}", file=self._stream)
        elif kind == "frame" and self._on_terminal:
            self._line(int(event["done"]), int(event["of"]))
        elif kind == "finished":
            if self._on_terminal:
                print(file=self._stream)
            present = f", {event['present']} were there" if event["present"] else ""
            print(
                f"itmo-video: {event['written']} frames made{present}, "
                f"{event['seconds']:.1f} s, {event['bytes_written'] / 1e6:.1f} MB",
                file=self._stream,
            )

    def _line(self, done: int, total: int) -> None:
        elapsed = max(time.monotonic() - self._began, 1e-6)
        rate = done / elapsed
        left = (total - done) / rate
        text = f"\r{done}/{total} frames, {rate:.1f} fps, {left:.0f} s left "
        print(text, end="", file=self._stream, flush=True)
