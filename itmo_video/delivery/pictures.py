"""Where previews get their pictures from: a clip converted on the fly, or a converted folder."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any, TypeVar

import numpy.typing as npt

from itmo_video.model import Float32, Frame, Half

T = TypeVar("T")


@dataclass(frozen=True)
class Picture:
    """One finished frame: planar linear RGB, 1.0 = SDR white, and its source frame if known."""

    index: int
    number: int
    time_s: Fraction
    rgb: tuple[Half | Float32, Half | Float32, Half | Float32]
    source: Frame | None = None
    layers: Mapping[str, npt.NDArray[Any]] = field(default_factory=dict)


Work = Callable[[Picture], T]


@dataclass
class Pictures:
    """A film's pictures and what is said of all of them; `mapped` makes something of each.

    `stream` is the number of the source's video stream that was asked for. `last_length_s` is how
    long the last one is shown, None for as long as one is at `frame_rate`. `damage` is filled
    while they are made: what was cut short or missing; `notices` is what should be reported
    before.
    """

    size: tuple[int, int]
    frame_rate: Fraction
    pixel_aspect: Fraction
    white_nits: float
    peak_nits: float
    primaries: str
    numbers: Sequence[int]
    clip: Path | None
    _mapped: Callable[[Callable[[Picture], Any]], Iterator[Any]]
    stream: int | None = None
    last_length_s: Fraction | None = None
    damage: list[str] = field(default_factory=list)
    notices: tuple[str, ...] = ()

    def mapped(self, work: Work[T]) -> Iterator[T]:
        """`work` of each picture in presentation order; it runs in several threads at once."""
        return self._mapped(work)
