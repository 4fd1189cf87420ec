"""The events that a command reports while it runs; each is a line of `--json`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any, ClassVar, TypeAlias


@dataclass(frozen=True)
class Started:
    """Work starts on `frames` frames, of which `present` already exist."""

    name: ClassVar = "started"

    input: str
    output: str
    frames: int
    present: int


@dataclass(frozen=True)
class FrameDone:
    """The frame `number` (as in file names) is finished, number `done` `of` all."""

    name: ClassVar = "frame"

    number: int
    done: int
    of: int


@dataclass(frozen=True)
class Warned:
    """Something the user should know: an assumption, low disk space, damage."""

    name: ClassVar = "warning"

    message: str


@dataclass(frozen=True, kw_only=True)
class Finished:
    """The work is done; values that do not apply to a command are None.

    `missing` and `damaged` are frame numbers; light levels are those of a film, in nits;
    `peak_nits` is the brightest channel of the EXR frames written.
    """

    name: ClassVar = "finished"

    wanted: int | None = None
    present: int
    written: int
    missing: Sequence[int] | None = None
    damaged: Sequence[int] | None = None
    seconds: float
    bytes_written: int
    max_cll: float | None = None
    max_fall: float | None = None
    peak_nits: float | None = None


@dataclass(frozen=True)
class Failed:
    """An input had an error, with its exit code; for `--json` only, as Python raises the error.

    Others of the same command go on. Frames that were finished stay.
    """

    name: ClassVar = "failed"

    input: str
    message: str
    exit_code: int


Event: TypeAlias = Started | FrameDone | Warned | Finished
OnEvent: TypeAlias = Callable[[Event], None]


def ignore(event: Event) -> None:
    """Report nothing."""


def as_json(event: Event | Failed) -> dict[str, Any]:
    """An event as in `--json`: "event" and its values."""
    told = {name: value for name, value in asdict(event).items() if value is not None}
    return {"event": event.name, **told}
