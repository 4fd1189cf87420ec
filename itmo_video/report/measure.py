"""What a report tells of each frame, and of all frames: light, map, flicker, cuts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import pairwise

import cv2
import numpy as np

from itmo_video.colour import linear_light
from itmo_video.colour.analysis_picture import analysis_size
from itmo_video.colour.primaries import luminance_weights
from itmo_video.delivery import hdr
from itmo_video.delivery.hdr import Light
from itmo_video.delivery.pictures import Picture
from itmo_video.evaluation import flicker
from itmo_video.model import Code, Encoding, Float32, Float64, Frame
from itmo_video.motion.shots import TINY_SIZE, Analysed, analyse_frame, place

BINS_A_STOP = 2
LOWEST_STOP = -14
HIGHEST_STOP = 16
PERCENTILES = (1, 50, 90, 99)
_SMALL_WIDTH = 160  # of maps and gains as flicker is measured
_NO_ENCODING = Encoding("grey", 8, "bt709", "full", "bt1886", "rec709")
_NO_GUIDE, _NO_GREY = np.zeros((1, 1), np.float32), np.zeros((1, 1), np.uint8)


@dataclass(frozen=True)
class FrameFacts:
    """One frame measured: luminance in nits, `coverage` the map's mean, 0 to 1, None if unknown.

    `histogram` counts pixels by half stops of luminance about SDR white from LOWEST_STOP up.
    """

    index: int
    number: int
    time_s: Fraction
    light: Light
    maximum: float
    mean: float
    percentiles: tuple[float, ...]
    at_peak: float
    not_finite: int
    histogram: Float64
    coverage: float | None
    map_small: Float32 | None = None
    gain_small: Float32 | None = None
    grey: Code | None = None
    tiny: Float32 | None = None


@dataclass
class FilmFacts:
    """All frames measured: `cuts` and `keys` are indices; flickers by frame, None if unknown.

    Flicker is the mean absolute change from the frame before along the motion between them, 0 for
    the first frame of a shot.
    """

    frames: list[FrameFacts]
    light: Light
    cuts: list[int] = field(default_factory=list)
    keys: list[int] = field(default_factory=list)
    map_flicker: list[float] | None = None
    gain_flicker: list[float] | None = None

    @property
    def histogram(self) -> Float64:
        """Share of all pixels in each half stop from LOWEST_STOP up; sums to 1."""
        total = np.sum([frame.histogram for frame in self.frames], axis=0)
        return np.asarray(total / max(1.0, total.sum()), np.float64)


def luminance_of(picture: Picture, primaries: str) -> Float32:
    """Relative luminance of a picture, SDR white = 1: float32 (H, W)."""
    r, g, b = luminance_weights(primaries)
    red, green, blue = (cv2.multiply(plane, 1.0, dtype=cv2.CV_32F) for plane in picture.rgb)
    total = cv2.scaleAdd(blue, b, cv2.addWeighted(red, r, green, g, 0))
    return np.asarray(total, np.float32).reshape(picture.rgb[0].shape)


def measure(
    picture: Picture, primaries: str, white_nits: float, peak_nits: float, map_width: int
) -> FrameFacts:
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
    low, *_ = percentiles = np.percentile(luminance, PERCENTILES) * white_nits
    assert low is not None
    map_full = picture.layers.get("expand_map.Y")
    map_small = None if map_full is None else _small(np.asarray(map_full, np.float32))
    return FrameFacts(
        picture.index, picture.number, picture.time_s, hdr.frame_light(nits),
        float(luminance.max()) * white_nits, float(luminance.mean()) * white_nits,
        tuple(float(p) for p in percentiles),
        float(np.mean(luminance >= 0.98 * peak_nits / white_nits)), broken,
        counts.astype(np.float64), None if map_small is None else float(map_small.mean()),
        map_small, _gain(picture, luminance), _grey(luminance),
        _tiny(picture, luminance, map_width),
    )  # fmt: skip


def film_facts(frames: Sequence[FrameFacts], key_interval: int) -> FilmFacts:
    """Put frames in presentation order together; finds cuts and keys as the conversion does."""
    facts = FilmFacts(list(frames), hdr.film_light(frame.light for frame in frames))
    analysed = [
        Analysed(Frame(f.index, f.time_s, (), _NO_ENCODING), _NO_GUIDE, _NO_GREY, f.tiny)
        for f in frames
        if f.tiny is not None
    ]
    for placed in place(analysed, key_interval, frames[0].index):
        index = placed.analysed.index
        if placed.starts_shot and index != frames[0].index:
            facts.cuts.append(index)
        if placed.is_key:
            facts.keys.append(index)
    maps, gains = [0.0], [0.0]
    for before, after in pairwise(facts.frames):
        follows = after.index == before.index + 1 and after.index not in facts.cuts
        changed = _changes(before, after) if follows else (0.0, 0.0)
        maps.append(changed[0])
        gains.append(changed[1])
    facts.map_flicker = maps if all(f.map_small is not None for f in frames) else None
    facts.gain_flicker = gains if all(f.gain_small is not None for f in frames) else None
    return facts


def _changes(before: FrameFacts, after: FrameFacts) -> tuple[float, float]:
    """Mean absolute changes of map and gain along motion; 0 where unknown."""
    if before.grey is None or after.grey is None:
        return 0.0, 0.0
    flow, valid = flicker.estimated_flow(after.grey, before.grey)
    pairs = ((before.map_small, after.map_small), (before.gain_small, after.gain_small))
    changes = [
        0.0
        if a is None or b is None or not valid.any()
        else flicker.change_along(a, b, flow, valid)
        for a, b in pairs
    ]
    return changes[0], changes[1]


def _small(plane: Float32) -> Float32:
    size = analysis_size(plane.shape[1], plane.shape[0], _SMALL_WIDTH)
    return np.asarray(cv2.resize(plane, size, interpolation=cv2.INTER_AREA), np.float32)


def _gain(picture: Picture, luminance: Float32) -> Float32 | None:
    """Stops that the frame was raised by, small: from its layer, or by dividing by the source."""
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
    """The result in SDR's range as 8-bit codes, small: what motion is found from."""
    code = np.clip(_small(luminance), 0, 1) ** np.float32(1 / 2.4)
    return np.asarray(np.rint(255 * code), np.uint8)


def _tiny(picture: Picture, luminance: Float32, map_width: int) -> Float32:
    if picture.source is not None:
        return analyse_frame(picture.source, map_width).tiny
    # Without the source the result's own lower tones, which the operators leave nearly alone.
    code = np.clip(luminance, 0, 1) ** np.float32(1 / 2.4)
    return np.asarray(cv2.resize(code, TINY_SIZE, interpolation=cv2.INTER_AREA))
