"""Measurements for a report, per frame and for the whole film: light, map, flicker, cuts."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import chain

import cv2
import numpy as np

from itmo_video.colour import linear_light
from itmo_video.colour.analysis_picture import analysis_size
from itmo_video.colour.primaries import luminance_weights
from itmo_video.colour.transfer import BT1886_GAMMA
from itmo_video.delivery import hdr
from itmo_video.delivery.hdr import Light
from itmo_video.delivery.pictures import Picture
from itmo_video.evaluation import flicker
from itmo_video.model import Code, Float32, Float64
from itmo_video.motion.cut_detection import TINY_SIZE, analyse_frame, place
from itmo_video.operators.auto_rendering import Rendering, mean_rendering, rendering_of_frame

BINS_A_STOP = 2
LOWEST_STOP = -14
HIGHEST_STOP = 16
PERCENTILES = (1, 50, 90, 99)
_SMALL_WIDTH = 160  # of the maps and gains that flicker is measured on


@dataclass(frozen=True)
class FrameFacts:
    """Measurements of a frame: luminance in nits; `coverage` is the map's mean, None if unknown."""

    index: int
    number: int
    time_s: Fraction
    light: Light
    maximum: float
    mean: float
    percentiles: tuple[float, ...]
    at_peak: float
    not_finite: int
    coverage: float | None


@dataclass(frozen=True, eq=False)
class Measured:
    """A frame's measurements, and small pictures of it to compare with its neighbours.

    `histogram` counts pixels per half stop of luminance relative to SDR white, from LOWEST_STOP up;
    `rendering` is the estimated rendering to SDR, None without a source.
    """

    facts: FrameFacts
    histogram: Float64
    map_small: Float32 | None
    gain_small: Float32 | None
    grey: Code
    tiny: Float32
    rendering: Rendering | None = None

    @property
    def index(self) -> int:
        """The index in presentation order."""
        return self.facts.index


@dataclass(frozen=True)
class ShotFacts:
    """A shot from cut to cut, by frame number, and its estimated rendering to SDR."""

    first: int
    last: int
    rendering: Rendering


@dataclass(frozen=True)
class FilmFacts:
    """Measurements of all frames: `cuts` and `keys` are indices; flicker per frame or None.

    Flicker is the mean absolute change from the previous frame along the motion between them, 0 for
    the first frame of a shot. `histogram` is the share of all pixels in each half stop from
    LOWEST_STOP up; it sums to 1. `shots` need the source.
    """

    frames: list[FrameFacts]
    light: Light
    histogram: Float64
    cuts: list[int]
    keys: list[int]
    map_flicker: list[float] | None
    gain_flicker: list[float] | None
    shots: list[ShotFacts] = field(default_factory=list)


def luminance_of(picture: Picture, primaries: str) -> Float32:
    """Relative luminance of a picture, SDR white = 1: float32 (H, W)."""
    r, g, b = luminance_weights(primaries)
    red, green, blue = (cv2.multiply(plane, 1.0, dtype=cv2.CV_32F) for plane in picture.rgb)
    total = cv2.scaleAdd(blue, b, cv2.addWeighted(red, r, green, g, 0))
    return np.asarray(total, np.float32).reshape(picture.rgb[0].shape)


def measure(
    picture: Picture, primaries: str, white_nits: float, peak_nits: float, map_width: int
) -> Measured:
    """Measure one frame; thread-safe."""
    luminance = luminance_of(picture, primaries)
    finite = np.isfinite(luminance)
    broken = int(luminance.size - np.count_nonzero(finite))
    if broken:
        luminance = np.where(finite, luminance, np.float32(0))
    nits = hdr.to_nits_2020(picture.rgb, primaries, white_nits, max(peak_nits, 1.0) * 1e3)
    stops = np.log2(np.maximum(luminance, 2.0**LOWEST_STOP))
    counts, _ = np.histogram(
        stops, (HIGHEST_STOP - LOWEST_STOP) * BINS_A_STOP, (LOWEST_STOP, HIGHEST_STOP)
    )
    percentiles = np.percentile(luminance, PERCENTILES) * white_nits
    map_full = picture.layers.get("expand_map.Y")
    map_small = None if map_full is None else _small(np.asarray(map_full, np.float32))
    facts = FrameFacts(
        picture.index, picture.number, picture.time_s, hdr.frame_light(nits),
        float(luminance.max()) * white_nits, float(luminance.mean()) * white_nits,
        tuple(percentiles.tolist()),
        float(np.mean(luminance >= 0.98 * peak_nits / white_nits)), broken,
        None if map_small is None else float(map_small.mean()),
    )  # fmt: skip
    source = picture.source
    return Measured(
        facts, counts.astype(np.float64), map_small, _gain(picture, luminance), _grey(luminance),
        _tiny(picture, luminance, map_width),
        None if source is None else rendering_of_frame(source, map_width),
    )  # fmt: skip


def film_facts(frames: Iterable[Measured], key_interval: int) -> FilmFacts:
    """Combine frames in presentation order; finds cuts and keyframes as the conversion does.

    Keeps the small pictures of a few neighbours only, however long the film is. There must be one
    frame.
    """
    source = iter(frames)
    first = next(source)
    start, total = first.index, np.zeros_like(first.histogram)
    facts: list[FrameFacts] = []
    cuts: list[int] = []
    keys: list[int] = []
    maps: list[float | None] = []
    gains: list[float | None] = []
    shots: list[tuple[int, int, list[Rendering]]] = []
    before: Measured | None = None
    waiting = chain((first,), source)
    del first  # otherwise it would be kept to the end
    for placed in place(waiting, key_interval, start):
        now = placed.analysed
        starts_shot = before is None or placed.starts_shot
        if starts_shot and before is not None:
            cuts.append(now.index)
        if now.rendering is not None:
            number = now.facts.number
            begun, _, told = (number, 0, []) if starts_shot or not shots else shots.pop()
            told.append(now.rendering)
            shots.append((begun, number, told))
        if placed.is_key:
            keys.append(now.index)
        map_change, gain_change = _changes(now if before is None else before, now, starts_shot)
        maps.append(map_change)
        gains.append(gain_change)
        facts.append(now.facts)
        total += now.histogram
        before = now
    return FilmFacts(
        facts, hdr.film_light(frame.light for frame in facts), total / max(1.0, total.sum()),
        cuts, keys, _if_all_known(maps), _if_all_known(gains),
        [ShotFacts(begun, last, mean_rendering(told)) for begun, last, told in shots],
    )  # fmt: skip


def _if_all_known(values: list[float | None]) -> list[float] | None:
    known = [value for value in values if value is not None]
    return known if len(known) == len(values) else None


def _changes(
    before: Measured, now: Measured, starts_shot: bool
) -> tuple[float | None, float | None]:
    """Mean absolute changes of map and gain along the motion; None without a map or a gain."""
    if starts_shot:
        return None if now.map_small is None else 0.0, None if now.gain_small is None else 0.0
    pairs = ((before.map_small, now.map_small), (before.gain_small, now.gain_small))
    flow, valid = flicker.estimated_flow(now.grey, before.grey)
    changes = [
        None
        if a is None or b is None
        else flicker.change_along(a, b, flow, valid)
        if valid.any()
        else 0.0
        for a, b in pairs
    ]
    return changes[0], changes[1]


def _small(plane: Float32) -> Float32:
    size = analysis_size(plane.shape[1], plane.shape[0], _SMALL_WIDTH)
    return np.asarray(cv2.resize(plane, size, interpolation=cv2.INTER_AREA), np.float32)


def _gain(picture: Picture, luminance: Float32) -> Float32 | None:
    """The frame's gain in stops, small: from its layer, or from the ratio to the source."""
    layer = picture.layers.get("gain.Y")
    if layer is not None:
        return np.log2(np.maximum(_small(np.asarray(layer, np.float32)), np.float32(1e-3)))
    if picture.source is None:
        return None
    red, green, blue = linear_light.to_rgb_linear(picture.source, clip=True)
    r, g, b = luminance_weights(picture.source.encoding.primaries)
    before = _small(np.asarray(red * r + green * g + blue * b, np.float32))
    return np.log2((_small(luminance) + np.float32(1e-3)) / (before + np.float32(1e-3)))


def _grey(luminance: Float32) -> Code:
    """The result within the range of SDR as small 8-bit codes, for finding motion."""
    code = np.clip(_small(luminance), 0, 1) ** np.float32(1 / BT1886_GAMMA)
    return np.asarray(np.rint(255 * code), np.uint8)


def _tiny(picture: Picture, luminance: Float32, map_width: int) -> Float32:
    if picture.source is not None:
        return analyse_frame(picture.source, map_width).tiny
    # Without the source: the result's lower tones, which the operators hardly change.
    code = np.clip(luminance, 0, 1) ** np.float32(1 / BT1886_GAMMA)
    return np.asarray(cv2.resize(code, TINY_SIZE, interpolation=cv2.INTER_AREA))
