"""The light levels of a film's shots, over all pixels of a shot, for dynamic metadata.

Memory is bounded: a shot is a histogram of max(R, G, B) in tenths of a nit, of any length.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from itmo_video.analysis.analyse import analyse
from itmo_video.conversion.run_options import RunOptions
from itmo_video.delivery import hdr
from itmo_video.delivery.light_levels import pictures_of
from itmo_video.delivery.pictures import Picture, Pictures
from itmo_video.delivery.ycbcr import Planes
from itmo_video.errors import DamagedInputError, UsageError
from itmo_video.events import FrameDone, OnEvent, Started, Warned, ignore
from itmo_video.output.converted import open_converted
from itmo_video.settings import Settings
from itmo_video.source.pipe import is_pipe

TENTHS = 100_000  # of a nit, PQ's 10,000


@dataclass(frozen=True)
class FrameTally:
    """One frame's max(R, G, B): counts by tenths of a nit, and exact values where needed.

    `maxima` are those of R, G and B in nits, `mean_pq` the mean of PQ's value, 0 to 1.
    """

    counts: npt.NDArray[np.int64]
    light: hdr.Light
    lowest_nits: float
    maxima_nits: tuple[float, float, float]
    mean_pq: float


class ShotLight:
    """Frames `first` to `last` (counted from 0 in the film), and their light so far."""

    def __init__(self, first: int) -> None:
        self.first, self.frames = first, 0
        self._counts = np.zeros(TENTHS + 1, np.int64)
        self._mean_nits = self._mean_pq = 0.0
        self.lowest_nits = float("inf")
        self.maxima_nits = (0.0, 0.0, 0.0)

    def add(self, frame: FrameTally) -> None:
        """Add a frame."""
        self.frames += 1
        self._counts[: frame.counts.size] += frame.counts
        self._mean_nits += frame.light.average
        self._mean_pq += frame.mean_pq
        self.lowest_nits = min(self.lowest_nits, frame.lowest_nits)
        red, green, blue = map(max, self.maxima_nits, frame.maxima_nits)
        self.maxima_nits = red, green, blue

    @property
    def mean_nits(self) -> float:
        """The mean of max(R, G, B)."""
        return self._mean_nits / max(1, self.frames)

    @property
    def mean_pq(self) -> float:
        """The mean of PQ's value of max(R, G, B), 0 to 1."""
        return self._mean_pq / max(1, self.frames)

    def percentile(self, percent: float) -> int:
        """The level in tenths of a nit that this share of all pixels does not exceed."""
        so_far = np.cumsum(self._counts)
        return int(np.searchsorted(so_far, percent / 100 * so_far[-1]))

    def share_within(self, nits: float) -> float:
        """The share of all pixels, in percent, that do not exceed `nits`."""
        return float(100 * self._counts[: round(nits * 10) + 1].sum() / self._counts.sum())


@dataclass(frozen=True)
class FilmLight:
    """A film's shots in order, its MaxCLL and MaxFALL, and its mastering peak."""

    shots: Sequence[ShotLight]
    light: hdr.Light
    peak_nits: float

    @property
    def frames(self) -> int:
        """The number of frames in the film."""
        return sum(shot.frames for shot in self.shots)


def film_light_by_shots(
    source: str | Path,
    settings: Settings | None,
    run: RunOptions,
    on_event: OnEvent = ignore,
    edit: str | Path | None = None,
) -> FilmLight:
    """Measure all frames of a clip, as rendered by `preview`, or of a converted folder.

    Shots are those of `run.analysis`, or those that `analyse` finds in the clip or in `edit`.
    Raises UsageError for a folder without an analysis, and DamagedInputError if any frame is
    missing.
    """
    source = Path(source)
    found = run.analysis
    if source.is_dir():
        if found is None:
            raise UsageError(
                "the shots of a converted folder are unknown", where=str(source),
                remedy="Give them: --analysis FILE.json, from itmo-video analyse CLIP --output.",
            )  # fmt: skip
        converted = open_converted(source)
        if found.digest != converted.manifest.source_digest:
            raise UsageError("the analysis belongs to another clip", where=found.where)
        offset = converted.first_number - found.first_number
    else:
        if is_pipe(source):
            raise UsageError(
                "a pipe can be read only once, but shots must be found first", where=str(source),
                remedy="Give the clip as a file; pipes work with --hdr10 only.",
            )  # fmt: skip
        if found is None:
            found = analyse(
                source, settings, start_number=run.start_number, max_pixels=run.max_pixels,
                edit=edit,
                on_event=lambda event: None if isinstance(event, FrameDone) else on_event(event),
            )  # fmt: skip
        first = found.first_number if run.start_number is None else run.start_number
        offset = first - found.first_number
    pictures = pictures_of(source, settings, run)
    # Frames between two shots form another shot here.
    starts = {n + offset for shot in found.shots for n in (shot.first, shot.last + 1)}
    return _by_shots(source, pictures, starts, on_event)


def _by_shots(source: Path, pictures: Pictures, starts: set[int], on_event: OnEvent) -> FilmLight:
    for notice in pictures.notices:
        on_event(Warned(notice))
    total = len(pictures.numbers)
    on_event(Started(str(source), "", total, 0))

    def measured(picture: Picture) -> tuple[int, FrameTally]:
        return picture.number, frame_tally(
            hdr.to_nits_2020(
                picture.rgb, pictures.primaries, pictures.white_nits, pictures.peak_nits
            )
        )

    shots: list[ShotLight] = []
    lights: list[hdr.Light] = []
    for done, (number, tally) in enumerate(pictures.mapped(measured), 1):
        if not shots or number in starts:
            shots.append(ShotLight(done - 1))
        shots[-1].add(tally)
        lights.append(tally.light)
        on_event(FrameDone(number, done, total))
    if pictures.damage:
        raise DamagedInputError("; ".join(pictures.damage), where=str(source))
    for told in pictures.damaged_in_words:
        on_event(Warned(f"{told}: the light is of what was decoded there"))
    return FilmLight(shots, hdr.film_light(lights), pictures.peak_nits)


def frame_tally(nits: Planes) -> FrameTally:
    """The light of one frame from its R, G, B in nits, 0 to 10000."""
    largest = cv2.max(cv2.max(nits[0], nits[1]), nits[2])
    tenths: Any = np.rint(np.minimum(largest, 10000) * np.float32(10)).astype(np.int64)
    red, green, blue = (float(cv2.minMaxLoc(plane)[1]) for plane in nits)
    return FrameTally(
        np.bincount(tenths.ravel()),
        hdr.frame_light(nits),
        float(cv2.minMaxLoc(largest)[0]),
        (red, green, blue),
        float(hdr.encode_plane(np.asarray(largest, np.float32), "pq").mean(dtype=np.float64)),
    )


def starts_and_lengths(shots: Iterable[ShotLight]) -> tuple[list[int], list[int]]:
    """The first frame of each shot, counted from 0, and its number of frames."""
    listed = list(shots)
    return [shot.first for shot in listed], [shot.frames for shot in listed]
