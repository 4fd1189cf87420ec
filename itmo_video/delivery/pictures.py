"""The pictures for previews: of a clip converted on the fly, or of a converted folder."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any, TypeVar

import numpy.typing as npt

from itmo_video.conversion.frame_ranges import damage_in_words
from itmo_video.model import Float32, Frame, Half

T = TypeVar("T")


@dataclass(frozen=True)
class Picture:
    """One finished frame: planar linear RGB, 1.0 = SDR white, and its source frame if known.

    Where it has `alpha` (0 to 1), RGB is associated: multiplied by it.
    """

    index: int
    number: int
    time_s: Fraction
    rgb: tuple[Half | Float32, Half | Float32, Half | Float32]
    source: Frame | None = None
    layers: Mapping[str, npt.NDArray[Any]] = field(default_factory=dict)
    alpha: Half | None = None


Work = Callable[[Picture], T]


@dataclass
class Pictures:
    """A film's pictures and facts about all of them; `mapped` processes each.

    `stream` is the requested number of the source's video stream. `last_length_s` is the duration
    of the last picture, None for the regular one at `frame_rate`. `damage` is filled during
    rendering: what was truncated or missing; so is `damaged`, the numbers of pictures whose source
    frame was damaged. `notices` should be reported first.
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
    damaged: set[int] = field(default_factory=set)

    @property
    def damaged_in_words(self) -> list[str]:
        """One sentence about the pictures whose source frame was damaged, or none."""
        return damage_in_words(self.damaged)

    def mapped(self, work: Work[T]) -> Iterator[T]:
        """Yield `work` of each picture in presentation order; `work` runs in several threads."""
        return self._mapped(work)
