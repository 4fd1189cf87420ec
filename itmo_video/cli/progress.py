"""Reporting progress: JSON lines for programs; a bar, the rate and the time left for people."""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TextIO

from itmo_video.cli.log_file import LogFile
from itmo_video.cli.terminal import PROGRAM, named, width_of
from itmo_video.errors import ItmoError
from itmo_video.events import (
    Event,
    Failed,
    Finished,
    FrameDone,
    OnEvent,
    Started,
    Warned,
    as_json,
)
from itmo_video.output.disk_space import in_words
from itmo_video.words import counted

_REDRAW_S = 0.1
_BAR, _NAME = 24, 30  # columns at most


class Progress:
    """Prints events: as JSON on standard output, or on standard error, with a bar on terminals.

    `is_verbose` prints a line for each frame; `log` always records them. Of a command with several
    inputs, `about` is the one that notices refer to and `place` says which it is: "2 of 4".
    """

    def __init__(
        self,
        *,
        as_json: bool,
        quiet: bool,
        stream: TextIO | None = None,
        is_verbose: bool = False,
        log: LogFile | None = None,
        about: str | None = None,
        place: str | None = None,
    ) -> None:
        self._as_json, self._quiet, self._is_verbose = as_json, quiet, is_verbose
        self._log = log
        self._about = f"{about}: " if about else ""
        self._place = f"{place}: " if place else ""
        self._stream = stream or sys.stderr
        self._has_bar = self._stream.isatty() and not (quiet or is_verbose)
        self._began = time.monotonic()
        self._drawn = float("-inf")
        self._name = self._output = ""
        self._shown = 0  # columns of the current line
        self._lost: Exception | None = None

    def on_event(self, event: Event) -> None:
        """Report one event."""
        if self._as_json:
            self._tell(json.dumps(as_json(event)))
        match event:
            case Started(source, output, frames, present):
                self._name, self._output = f"{self._place}{_named(source)}", output
                self._began = time.monotonic()
                to = f" to {output}" if output else ""
                there = f", {present} already present" if present else ""
                self.detail(f"{source}{to}: {counted(frames, 'frame') if frames else 'frames'}"
                            f"{' as they come' if not frames else ''}{there}")  # fmt: skip
                self._draw(0, frames - present)
            case Warned(message):
                self._say(f"{self._about}{message}", "yellow")
            case FrameDone(number, done, of):
                self.detail(f"frame {number}: {done}{f' of {of}' if of else ''}")
                self._draw(done, of)
                if done == of:
                    self.close()
            case Finished():
                self._sum_up(event)

    @contextmanager
    def on(self, source: str) -> Iterator[OnEvent]:
        """Show the input's name at once, as indexing a long film takes a while; gives `on_event`.

        At the end, the line is terminated.
        """
        self._name = f"{self._place}{_named(source)}"
        if self._has_bar:
            self._show(f"{self._place}opening {_named(source)}"[: width_of(self._stream) - 1])
        try:
            yield self.on_event
        finally:
            self.close()

    def detail(self, message: str) -> None:
        """Print details for --verbose and --log only."""
        if self._log is not None:
            self._log.write(message)
        if self._is_verbose:
            self.close()
            print(f"{PROGRAM}: {message}", file=self._stream)

    def close(self) -> None:
        """Terminate the current line on the terminal, so that others may print below it."""
        if self._shown:
            print(file=self._stream)
        self._shown = 0

    def _say(self, message: str, colour: str | None = None) -> None:
        if self._log is not None:
            self._log.write(message)
        if self._quiet:
            return
        self.close()
        told = named(message, self._stream, colour) if colour else f"{PROGRAM}: {message}"
        print(told, file=self._stream)

    def _tell(self, line: str) -> None:
        """Print a line to standard output; a closed reader does not stop the work."""
        if self._lost is not None:
            return
        try:
            print(line, flush=True)
        except (OSError, ValueError) as error:
            self._lost = error

    def _sum_up(self, event: Finished) -> None:
        output = "standard output" if self._output == "-" else self._output
        where = f"{self._place}{output}: " if output else self._place
        # EXRs have a peak in their own primaries; what is in BT.2020 has MaxCLL, often lower.
        brightest = f", peak {event.peak_nits:.0f} nits" if event.peak_nits else ""
        brightest = f", MaxCLL {event.max_cll:.0f} nits" if event.max_cll else brightest
        told = brightest
        if event.present:  # their light is not known
            own = f" ({brightest.removeprefix(', ')})" if brightest else ""
            told = f"{own}, {event.present} already present"
        self._say(
            f"{where}{counted(event.written, 'frame')} rendered{told}, "
            f"{event.seconds:.1f} s, {in_words(event.bytes_written)}"
        )

    def _draw(self, done: int, total: int) -> None:
        """Print the bar, at most ten times a second and at the end."""
        now = time.monotonic()
        if not self._has_bar or (done != total and now - self._drawn < _REDRAW_S):
            return
        self._drawn = now
        columns = width_of(self._stream) - 1
        self._show(bar_line(self._name, done, total, now - self._began, columns))

    def _show(self, text: str) -> None:
        print("\r" + text.ljust(self._shown), end="", file=self._stream, flush=True)
        self._shown = len(text)


@contextmanager
def failure_told(source: str, *, to_programs: bool) -> Iterator[None]:
    """Print an error about an input as an event, if `to_programs`, before it is raised."""
    try:
        yield
    except ItmoError as error:
        if to_programs:
            with suppress(OSError, ValueError):  # nobody reads; the exit code tells
                print(json.dumps(as_json(Failed(source, str(error), error.exit_code))), flush=True)
        raise


def _named(source: str) -> str:
    return "standard input" if source == "-" else os.path.basename(os.path.normpath(source))


def bar_line(name: str, done: int, total: int, elapsed_s: float, columns: int) -> str:
    """`clip.mp4 [####----] 12/48 frames, 5.1 fps, 0:07 left`, no wider than `columns`.

    `total` is 0 if unknown; the bar, then the name, are dropped if there is no room.
    """
    rate = done / max(elapsed_s, 1e-6)
    facts = f"{done}{f'/{total}' if total else ''} frames"
    if done:
        facts += f", {rate:.1f} fps"
        if total:
            facts += f", {_clock((total - done) / rate)} left"
    elif elapsed_s >= 1:
        facts += f", {_clock(elapsed_s)}"
    short = name if len(name) <= _NAME else f"{name[: _NAME - 3]}..."
    room = min(_BAR, columns - len(short) - len(facts) - 4)
    if total and room >= 8:
        full = room * min(done, total) // total
        return f"{short} [{'#' * full}{'-' * (room - full)}] {facts}"
    return (f"{short} {facts}" if columns > len(short) + len(facts) else facts)[: max(0, columns)]


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"
