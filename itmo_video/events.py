"""What a command reports while it runs: four events, and each as a line of `--json`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any, ClassVar, TypeAlias


@dataclass(frozen=True)
class Started:
    """Work begins on `frames` frames, of which `present` were made before."""

    name: ClassVar = "started"

    input: str
    output: str
    frames: int
    present: int


@dataclass(frozen=True)
class FrameDone:
    """The frame of this number, as in the file names, is finished: the `done`th `of` so many."""

    name: ClassVar = "frame"

    number: int
    done: int
    of: int


@dataclass(frozen=True)
class Warned:
    """Something that the user should know: an assumption, a shortage, damage."""

    name: ClassVar = "warning"

    message: str


@dataclass(frozen=True, kw_only=True)
class Finished:
    """The work is done; what a command knows nothing of is None.

    `missing` and `damaged` are numbers of frames; light levels are those of a film, in nits;
    `peak_nits` is the brightest channel of the EXR frames that were written.
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


Event: TypeAlias = Started | FrameDone | Warned | Finished
OnEvent: TypeAlias = Callable[[Event], None]


def ignore(event: Event) -> None:
    """Report nothing."""


def as_json(event: Event) -> dict[str, Any]:
    """An event as `--json` has it: "event" and its values."""
    told = {name: value for name, value in asdict(event).items() if value is not None}
    return {"event": event.name, **told}
