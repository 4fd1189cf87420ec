"""How close a sequence is to its truth, compared with the unchanged SDR clip."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import repeat
from pathlib import Path

from itmo_video.errors import InputError
from itmo_video.evaluation import fidelity
from itmo_video.evaluation.fidelity import Fidelity, Zone
from itmo_video.evaluation.folders import frame_rgb, open_sequence, open_source, pair
from itmo_video.events import FrameDone, OnEvent, ignore
from itmo_video.model import Float32, Float64, Frame
from itmo_video.source.files import MAX_PIXELS
from itmo_video.source.opening import frames_at

TEST, SDR = "test", "SDR as it is"
# Figures of a frame; True where more is better.
FIGURES = {
    "pq_psnr_db": True, "pu21_psnr_db": True, "pu21_ssim": True,
    "visible_share": False, "obvious_share": False,
}  # fmt: skip


@dataclass(frozen=True)
class Display:
    """The display that pictures are viewed on: nits, and pixels per degree of visual field."""

    peak_nits: float = 1000.0
    white_nits: float = 203.0
    pixels_per_degree: float = 45.0


@dataclass(frozen=True)
class Worst:
    """The worst frame by one figure; `number` is that in its file's name."""

    number: int
    value: float


@dataclass(frozen=True)
class Agreement:
    """Figures of a sequence by name, its zones and percentiles, and its worst frame by figure.

    `percentile_stops` and the shares are means over frames; zones' errors are means over pixels.
    """

    figures: dict[str, float]
    zones: tuple[Zone, ...]
    percentile_stops: dict[float, float]
    worst: dict[str, Worst]


class Tally:
    """Accumulates the agreement of a sequence frame by frame; holds sums, not frames."""

    def __init__(self) -> None:
        self._count = 0
        self._sums: dict[str, float] = {}
        self._worst: dict[str, Worst] = {}
        self._percentiles: dict[float, float] = {}
        self._zones: dict[tuple[float, float], list[float]] = {}

    def add(self, number: int, found: Fidelity) -> None:
        """Add one frame's figures."""
        self._count += 1
        for name, more_is_better in FIGURES.items():
            value = float(getattr(found, name))
            sign = 1 if more_is_better else -1
            worst = self._worst.get(name)
            if worst is None or sign * value < sign * worst.value:
                self._worst[name] = Worst(number, value)
            # PSNR by the clip's mean squared error: one identical frame must not make it infinite.
            part = 10 ** (-value / 10) if name.endswith("_db") else value
            self._sums[name] = self._sums.get(name, 0.0) + part
        for percentile, stops in found.percentiles.items():
            self._percentiles[percentile] = self._percentiles.get(percentile, 0.0) + stops
        for zone in found.zones:
            sums = self._zones.setdefault((zone.lower, zone.upper), [0.0, 0.0, 0.0])
            if zone.share:
                sums[0] += zone.share
                sums[1] += zone.share * zone.mean
                sums[2] += zone.share * zone.mean_abs

    def agreement(self) -> Agreement:
        """The figures of all frames added so far, of which there must be one."""
        count = self._count
        figures = {name: total / count for name, total in self._sums.items()}
        for name in figures:
            if name.endswith("_db"):
                error = figures[name]
                figures[name] = -10 * math.log10(error) if error else math.inf
        percentiles = {p: total / count for p, total in self._percentiles.items()}
        figures["peak_stops"] = percentiles[100.0]
        zones = tuple(
            Zone(lower, upper, share / count, mean / share, mean_abs / share)
            if share
            else Zone(lower, upper, 0.0, math.nan, math.nan)
            for (lower, upper), (share, mean, mean_abs) in self._zones.items()
        )
        return Agreement(figures, zones, percentiles, self._worst)


def compare_sequences(
    test: Path,
    reference: Path,
    source: Path | None,
    display: Display,
    on_event: OnEvent = ignore,
    part: str | None = None,
    max_pixels: int = MAX_PIXELS,
) -> dict[str, Agreement]:
    """Agreement of a folder with the true one, by row: TEST, and SDR if the clip is given.

    Frames are matched by the index of their source frame (folders.pair); of a reference with
    several parts `part` is read, by default the first with R, G and B. Raises InputError if
    the folders or the clip do not match.
    """
    sequence = open_sequence(test)
    pairs = pair(sequence, open_sequence(reference), part)
    originals: Iterable[Frame | None] = repeat(None)
    rows = {TEST: Tally()}
    if source is not None:
        rows[SDR] = Tally()
        clip = open_source(source, sequence, max_pixels)
        originals = frames_at(clip, [item.index for item in pairs])
    for done, (item, original) in enumerate(zip(pairs, originals, strict=False), 1):
        truth = _shown(item.true_rgb(), display, item.truth)
        pictures = {TEST: (item.rgb(), item.test)}
        if original is not None and source is not None:
            pictures[SDR] = (frame_rgb(original), source)
        for name, (rgb, where) in pictures.items():
            try:
                found = fidelity.compare(_shown(rgb, display, where), truth, display.white_nits)
            except ValueError as error:
                raise InputError(str(error), where=str(where)) from error
            rows[name].add(item.number, found)
        on_event(FrameDone(item.number, done, len(pairs)))
    return {name: tally.agreement() for name, tally in rows.items()}


def _shown(rgb: Float32, display: Display, where: Path) -> Float64:
    try:
        return fidelity.displayed(rgb, display.white_nits, display.peak_nits)
    except ValueError as error:
        raise InputError(str(error), where=str(where)) from error
