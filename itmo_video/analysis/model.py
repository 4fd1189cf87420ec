"""The file that `analyse` writes: what a clip is made of, and a list of shots to be edited by hand.

JSON with a format number; analysis/reading.py reads it back.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from fractions import Fraction
from typing import Any

FORMAT = 1
FORMAT_NAME = "itmo_video_analysis"


@dataclass(frozen=True)
class Statistics:
    """Luminance of some frames, SDR white = 1, taken at analysis size; `clipped` at full size.

    p1 to p99 are percentiles of the pixels; `clipped` is the share of pixels whose code is at least
    99 % of white (luma, or the largest of R, G, B); `change` the mean difference of neighbouring
    frames of a shot, 0 to 1.
    """

    mean: float
    p1: float
    p50: float
    p95: float
    p99: float
    maximum: float
    clipped: float
    change: float


@dataclass(frozen=True)
class Shot:
    """Frames `first` to `last`, numbered as in the file names, inclusive, and how they are made.

    `peak_nits` or `l_max` replaces the conversion's own; `strength` 0 to 1 weighs the expansion, on
    top of the conversion's; not `enabled` leaves the shot SDR.
    """

    first: int
    last: int
    peak_nits: float | None = None
    l_max: float | None = None
    strength: float = 1.0
    enabled: bool = True
    statistics: Statistics | None = None

    def changes(self, strength: float) -> dict[str, Any]:
        """The settings that differ in this shot, where `strength` is the conversion's own."""
        if not self.enabled:
            return {"strength": 0.0}
        changed: dict[str, Any] = {}
        if self.strength != 1.0:
            changed["strength"] = strength * self.strength
        if self.peak_nits is not None:
            changed |= {"peak_nits": self.peak_nits, "l_max": None}
        elif self.l_max is not None:
            changed["l_max"] = self.l_max
        return changed


@dataclass(frozen=True)
class Bars:
    """Black rows and columns around the picture in all frames, in pixels as decoded."""

    left: int = 0
    right: int = 0
    top: int = 0
    bottom: int = 0


@dataclass(frozen=True)
class Suggestion:
    """A setting that suits the clip, and why."""

    setting: str
    value: float | int | str | bool
    reason: str


@dataclass(frozen=True)
class Analysis:
    """A clip's cuts, keyframes, times, statistics and shots; numbers are those of the file names.

    `cuts` are the first frames of all shots but the first; `times_s` the presentation time of each
    frame that decodes; `where` is the file that it was read from.
    """

    source_name: str
    digest: str
    frames: int
    first_number: int
    cuts: tuple[int, ...]
    keyframes: tuple[int, ...]
    times_s: tuple[Fraction, ...]
    statistics: Statistics
    bars: Bars
    suggestions: tuple[Suggestion, ...]
    shots: tuple[Shot, ...]
    where: str | None = field(default=None, compare=False)

    def to_json(self) -> str:
        """JSON text, a line each for shots and short lists, so that it can be edited by hand."""
        data = asdict(self)
        del data["where"]
        data["times_s"] = [str(time) for time in self.times_s]
        lines = [f" {json.dumps(FORMAT_NAME)}: {FORMAT}"]
        for name, value in data.items():
            if name in ("shots", "suggestions"):
                rows = ",\n".join(f"  {json.dumps(row, allow_nan=False)}" for row in value)
                lines.append(f" {json.dumps(name)}: [\n{rows}\n ]")
            else:
                lines.append(f" {json.dumps(name)}: {json.dumps(value, allow_nan=False)}")
        return "{\n" + ",\n".join(lines) + "\n}\n"
