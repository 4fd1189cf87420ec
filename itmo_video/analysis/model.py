"""The file that `analyse` writes: facts about a clip, and a shot list to edit by hand.

JSON with a format number; analysis/reading.py reads it back.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from fractions import Fraction
from typing import Any

from itmo_video.presets import with_own
from itmo_video.settings import Settings

FORMAT = 2  # in 1 a shot's strength multiplied the conversion's
FORMAT_NAME = "itmo_video_analysis"
READ_ME = "read_me"
_HOW_TO_EDIT = (
    "Edit the shots: give one any setting of the look, as on the command line, such as "
    '"strength": 0.5 or "peak_nits": 600, or a "preset"; "enabled": false leaves it SDR; '
    'convert and preview read this file with --analysis. In statistics, "clipped" is the share of '
    'pixels whose luma (of RGB: a channel) is at 99 % of white or more; "rendering" counts those '
    "in which any channel clips"
)


@dataclass(frozen=True)
class Statistics:
    """Luminance statistics, SDR white = 1, measured at analysis size; `clipped` at full size.

    p1 to p99 are percentiles of the pixels; `clipped` is the share of pixels whose code is at least
    99 % of white (luma, or the largest of R, G, B); `change` is the mean difference between
    neighbouring frames of a shot, 0 to 1.
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
    """Frames `first` to `last` (as in file names, inclusive), and how they are converted.

    `own` is the shot's own look: settings by name, or a preset, applied like flags after those of
    the conversion. A shot that is not `enabled` is left SDR. `rendering` describes how it was
    rendered to SDR, for people only.
    """

    first: int
    last: int
    own: Mapping[str, Any] = field(default_factory=dict)
    enabled: bool = True
    statistics: Statistics | None = None
    rendering: str | None = None

    def settings(self, base: Settings) -> Settings:
        """Its frames' settings, given the conversion's `base`; raises UsageError."""
        own = with_own(base, self.own) if self.own else base
        return own if self.enabled else replace(base, strength=0.0)

    def to_row(self) -> dict[str, Any]:
        """The shot as in JSON, with its own settings among the other entries."""
        row = {"first": self.first, "last": self.last, "enabled": self.enabled, **self.own}
        if self.rendering is not None:
            row["rendering"] = self.rendering
        return row | {"statistics": None if self.statistics is None else asdict(self.statistics)}


@dataclass(frozen=True)
class Bars:
    """Black rows and columns around the picture in all frames, in pixels as decoded."""

    left: int = 0
    right: int = 0
    top: int = 0
    bottom: int = 0


@dataclass(frozen=True)
class Suggestion:
    """A suggested setting, and the reason."""

    setting: str
    value: float | int | str | bool
    reason: str


@dataclass(frozen=True)
class Analysis:
    """A clip's cuts, keyframes, times, statistics and shots; numbers are as in file names.

    `cuts` are the first frames of all shots except the first; `times_s` the presentation times of
    decodable frames; `where` is the file that it was read from.

    >>> from itmo_video import analyse
    >>> found = analyse("clip.mkv")
    >>> found.frames, found.cuts, found.keyframes[0]
    (3, (), 1)
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
        """JSON text with one line per shot and short list, for editing by hand."""
        data = asdict(self)
        del data["where"]
        data["times_s"] = [str(time) for time in self.times_s]
        data["shots"] = [shot.to_row() for shot in self.shots]
        lines = [f" {json.dumps(FORMAT_NAME)}: {FORMAT}"]
        lines.append(f" {json.dumps(READ_ME)}: {json.dumps(_HOW_TO_EDIT)}")
        for name, value in data.items():
            if name in ("shots", "suggestions"):
                rows = ",\n".join(f"  {json.dumps(row, allow_nan=False)}" for row in value)
                lines.append(f" {json.dumps(name)}: [\n{rows}\n ]")
            else:
                lines.append(f" {json.dumps(name)}: {json.dumps(value, allow_nan=False)}")
        return "{\n" + ",\n".join(lines) + "\n}\n"
