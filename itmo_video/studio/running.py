"""One render at a time, as a separate process: it continues when the page is closed."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from itmo_video.errors import UsageError

State = Literal["none", "running", "done", "failed", "cancelled"]
RENDERS_AGAIN = {"convert": "--update", "preview": "--overwrite"}  # what exists, by command
_PATIENCE_S = 20  # for a command that was asked to stop


@dataclass
class Progress:
    """The progress of the render, for the page."""

    state: State = "none"
    kind: str = ""
    output: str = ""
    done: int = 0
    of: int = 0
    seconds: float = 0.0
    left_s: float | None = None
    message: str = ""
    is_ending: bool = False  # it was cancelled and finishes its frame


class Runner:
    """Starts `itmo-video` and follows its events."""

    def __init__(self) -> None:
        self.progress = Progress()
        self._process: subprocess.Popen[str] | None = None
        self._follower: threading.Thread | None = None
        self._lock = threading.Lock()

    def start(self, kind: str, arguments: Sequence[str], output: Path) -> None:
        """Run `itmo-video ARGUMENTS --json`; raises UsageError while another render runs.

        One that is cancelled runs until its process has ended: two would write into one folder.
        """
        with self._lock:
            if self.progress.state == "running":
                raise UsageError("a render is already running", remedy="Wait for it, or cancel it.")
            # In its own session: the studio passes on Ctrl-C from its terminal itself.
            self._process = subprocess.Popen(
                [sys.executable, "-m", "itmo_video", *arguments, "--json"],
                stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                text=True, errors="backslashreplace", start_new_session=True,
            )  # fmt: skip
            self.progress = Progress("running", kind, str(output))
            self._follower = threading.Thread(
                target=self._follow, args=(self._process, self.progress), daemon=True
            )
            self._follower.start()

    def cancel(self) -> None:
        """Interrupt the render, if one is running; finished frames stay intact."""
        process = self._process
        if process is None or self.progress.state != "running":
            return
        self.progress.is_ending = True
        with suppress(ProcessLookupError):
            process.send_signal(signal.SIGINT)

    def close(self) -> None:
        """Interrupt the render and wait until it has ended."""
        self.cancel()
        process = self._process
        if process is not None:
            with suppress(subprocess.TimeoutExpired):
                process.wait(_PATIENCE_S)
            if process.poll() is None:
                process.kill()
        if self._follower is not None:
            self._follower.join()

    def _follow(self, process: subprocess.Popen[str], progress: Progress) -> None:
        assert process.stdout is not None
        assert process.stderr is not None
        began = time.monotonic()
        told: list[str] = []
        errors = threading.Thread(target=_gather, args=(process.stderr, told), daemon=True)
        errors.start()
        for line in process.stdout:
            event = _event(line)
            if event.get("event") == "frame":
                progress.done, progress.of = int(event["done"]), int(event["of"])
                progress.seconds = time.monotonic() - began
                rate = progress.done / max(progress.seconds, 1e-6)
                progress.left_s = (progress.of - progress.done) / rate if rate else None
        code = process.wait()
        errors.join()
        process.stdout.close()
        process.stderr.close()
        progress.seconds, progress.left_s = time.monotonic() - began, None
        if code == 0:
            progress.state = "done"
        elif progress.is_ending:
            progress.state = "cancelled"
        else:
            progress.message = "\n".join(for_page(told[-4:], progress.kind)) or f"exit code {code}"
            progress.state = "failed"


def for_page(lines: Sequence[str], kind: str) -> list[str]:
    """What a command said, with remedies that can be had on the page in place of flags."""
    again = "Tick “Re-render what exists”, or choose another name."
    return [
        again if RENDERS_AGAIN[kind] in line
        else "Choose another name." if "--overwrite" in line
        else line
        for line in lines
    ]  # fmt: skip


def _gather(stream: Any, told: list[str]) -> None:
    for line in stream:
        told.append(line.rstrip("\n"))
        del told[:-20]


def _event(line: str) -> dict[str, Any]:
    with suppress(ValueError):
        found = json.loads(line)
        if isinstance(found, dict):
            return found
    return {}
