"""Estimating how footage was rendered to SDR, from one picture, and where eq. 11 inverts that.

Two kinds of footage need opposite treatment. A camera that clips leaves everything below white
unchanged and loses what lies above; a tone-mapped picture (phones, grading, broadcast) has its
highlights compressed into the upper half of the codes, which the paper's curve inverts. They are
distinguished by how many pixels are at the last codes compared with those just below: a shoulder
leaves hardly any there, while a clipping camera piles up everything brighter.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from itmo_video.colour import linear_light
from itmo_video.colour.analysis_picture import analysis_size
from itmo_video.colour.luminance import greatest_of, luminance_of_pixels
from itmo_video.colour.transfer import BT1886_GAMMA
from itmo_video.model import Float32, Frame
from itmo_video.operators.ramps import ramp, ramps

CLIPPED_FROM = 0.975  # of white, linear: compression lets clipped areas waver
BRIGHT_FROM = 0.3
# Clipped over bright pixels: below the first a picture was tone-mapped, above the second clipped.
# The first pair is for smooth histograms, the second for codes piled up at white, for which the
# share of clipped pixels also counts (PILED_SHARES).
SMOOTH_RATIOS, PILED_RATIOS, PILED_SHARES = (0.03, 0.065), (0.026, 0.038), (0.0085, 0.0105)
JUST_BELOW = 0.95  # of white; clipped over pixels from here on: smooth below 1.3, piled up from 2
SMOOTH_PILE, WHOLE_PILE = 1.3, 2.0
WHITE_SHARE = 0.999  # of the pixels are below the level called white
WHITE_LOW, WHITE_FULL = 0.8, 0.95  # with white below the first, it was not tone-mapped
LOW_RANGE, FULL_RANGE = 2.0, 2.6  # stops from the darkest tenth to white: less needs none
DARK_CODE, ORDINARY_CODE = 0.2, 0.35  # of the middle tone, BT.1886
GREATEST_WEIGHT = 2.5  # of eq. 11's gain


@dataclass(frozen=True)
class Rendering:
    """Measures of how a picture was rendered to SDR; shares of its pixels, 0 to 1.

    By the highest channel: `clipped` are at white, `bright` between 0.3 of white and there,
    `just_below` in the last fortieth below. A tenth of the pixels are below the level `dark`, all
    but a thousandth below `white`, relative to SDR white; `middle_code` is the median's code.
    `tone_mapped` is 0 for a camera that clips, 1 for compressed highlights; `night` is 1 if the
    picture is dark, so that bright areas are lights.
    """

    clipped: float
    bright: float
    white: float
    middle_code: float
    just_below: float
    dark: float
    footage: str = "auto"

    @property
    def measures(self) -> tuple[float, ...]:
        """The measured values, without `footage`, which the user sets."""
        return self.clipped, self.bright, self.white, self.middle_code, self.just_below, self.dark

    @property
    def tone_mapped(self) -> float:
        """How far eq. 11 applies: 1 if it is right, 0 if it would harm."""
        if self.footage != "auto":
            return float(self.footage == "tone-mapped")
        ratio = math.log((self.clipped + 1e-6) / (self.bright + 1e-4))
        pile = math.log((self.clipped + 1e-6) / (self.just_below + 1e-5))
        piled = ramp(pile, math.log(SMOOTH_PILE), math.log(WHOLE_PILE))
        smooth = ramp(ratio, *map(math.log, SMOOTH_RATIOS))
        steep = max(ramp(ratio, *map(math.log, PILED_RATIOS)), ramp(self.clipped, *PILED_SHARES))
        folded = (1 - piled) * (1 - smooth) + piled * (1 - steep)
        range_stops = math.log2(max(self.white, 1e-3) / max(self.dark, 1e-3))
        folded *= ramp(range_stops, LOW_RANGE, FULL_RANGE)
        return folded * ramp(self.white, WHITE_LOW, WHITE_FULL)

    @property
    def caution(self) -> float:
        """The share of the network's stops that is used: 0.8 if little clips, 1 from 8 % on.

        If little clips, SDR is close to the truth, and overestimates do most harm: on 23 scenes
        not used for fitting, this halves the worst loss and costs 0.1 dB of the mean.
        """
        return 0.8 + 0.2 * ramp(self.clipped, 0.02, 0.08)

    @property
    def night(self) -> float:
        """1 for dark pictures, 0 from ordinary middle tones on."""
        return 1 - ramp(self.middle_code, DARK_CODE, ORDINARY_CODE)

    def in_words(self, l_max: float) -> str:
        """One line about what was found and what is done."""
        reached = f"the brightest reach {self.white:.0%} of"
        if self.tone_mapped >= 0.5:
            how = "highlights roll off" if self.clipped < 0.005 else "highlights are compressed"
            return (
                f"{how}, {reached} white: tone-mapped; expanded by the paper's curve with L'max "
                f"{l_max**self.tone_mapped:.1f}"
            )
        if self.white < WHITE_FULL and self.clipped < 1e-3:
            if self.clipped == 0:
                return f"nothing reaches white ({reached} it): left as it is"
            return "hardly anything clips (less than 0.1%): only that is expanded"
        at_white = f"a channel at {CLIPPED_FROM:.1%} of white"
        return (
            f"{self.clipped:.1%} clipped ({at_white}), as by a camera; clipped highlights are "
            "restored"
        )


def rendering_of(rgb_linear: Float32, footage: str = "auto") -> Rendering:
    """Measure a picture's rendering; `rgb_linear` is float32 (H, W, 3) in [0, 1], at analysis size.

    `footage` is the setting of that name, which overrides the estimate unless it is "auto".
    """
    greatest = greatest_of(rgb_linear)
    clipped, just_below, bright = (
        np.count_nonzero(greatest >= np.float32(light))
        for light in (CLIPPED_FROM, JUST_BELOW, BRIGHT_FROM)
    )
    dark, middle, white = _quantiles(greatest, (0.1, 0.5, WHITE_SHARE))
    return Rendering(
        clipped / greatest.size,
        (bright - clipped) / greatest.size,
        float(white),
        float(middle) ** (1 / BT1886_GAMMA),
        (just_below - clipped) / greatest.size,
        float(dark),
        footage,
    )


def _quantiles(values: Float32, shares: Sequence[float]) -> list[float]:
    """Np.quantile of values of at least 0, in a third of the time.

    The upper half of a float's bits says which values are near a quantile; only these are sorted.
    """
    values = values.ravel() + np.float32(0)  # which makes 0 of -0
    upper = values.view(np.uint32) >> 16
    ends = np.cumsum(np.bincount(upper.view(np.int32)))
    found = []
    for share in shares:
        place = share * (values.size - 1)
        below = math.floor(place)
        first, last = np.searchsorted(ends, (below, min(below + 1, values.size - 1)), "right")
        near = np.sort(values[(upper >= first) & (upper <= last)])
        skipped = int(ends[first - 1]) if first else 0
        low, high = near[below - skipped], near[min(below + 1, values.size - 1) - skipped]
        found.append(float(low) + (place - below) * (float(high) - float(low)))
    return found


def rendering_of_frame(frame: Frame, map_width: int, footage: str = "auto") -> Rendering:
    """Measure a frame's rendering from its codes, area-averaged to analysis size."""
    planes = averaged_codes_linear(frame, map_width)
    return rendering_of(np.clip(np.dstack(planes), 0, 1), footage)


def averaged_codes_linear(frame: Frame, map_width: int) -> linear_light.Planes:
    """Linear R, G, B, clipped, of codes area-averaged to analysis size: float32 (H, W) each."""
    size = analysis_size(*frame.size, map_width)
    planes = tuple(cv2.resize(p, size, interpolation=cv2.INTER_AREA) for p in frame.planes)
    return linear_light.to_rgb_linear(replace(frame, planes=planes), clip=True)


def mean_rendering(renderings: Sequence[Rendering]) -> Rendering:
    """The mean of a shot's renderings, of which there must be one."""
    measures = np.mean([one.measures for one in renderings], axis=0).tolist()
    return Rendering(*measures)


def curve_weight(rgb_linear: Float32, rendering: Rendering, lamps: float) -> Float32:
    """Eq. 11's weight at each pixel, over GREATEST_WEIGHT: float32 (H, W) in [0, 1].

    The exponent of eq. 11's gain; 0 leaves a pixel unchanged. Half of it applies to the whole
    picture, half is the density of light nearby, as in the paper's Expand Map; `lamps` weights
    small lights.
    """
    tone_mapped, night = rendering.tone_mapped, rendering.night
    if tone_mapped == 0:
        return np.zeros(rgb_linear.shape[:2], np.float32)
    luminance = luminance_of_pixels(rgb_linear)
    weight = light_density(luminance)
    weight *= np.float32(0.5 * (1 + night))
    weight += np.float32(0.5 * (1 + night))
    dark = max(night, min(lamps - 1, 1.0))  # above 1, lamps count in daylight, too
    if lamps > 0 and dark > 0:
        weight += np.float32(lamps * dark) * small_lights(greatest_of(rgb_linear))
    weight *= np.float32(tone_mapped / GREATEST_WEIGHT)
    return np.asarray(np.minimum(weight, 1), np.float32)


def light_density(luminance: Float32) -> Float32:
    """The density of light, as by median cut with many lights and a soft disc: (H, W).

    All lights of a median cut have the same power, so their density is the local mean of luminance
    over the picture's. It rises from 0 at 0.75 times that of a uniformly lit picture to 1 at 2.75
    times: the paper's threshold of 4 lights, counted softly (`expand_map.density`).
    """
    height, width = luminance.shape
    side = math.sqrt(height * width)
    size = (max(1, width // 4), max(1, height // 4))
    small = cv2.resize(luminance, size, interpolation=cv2.INTER_AREA).reshape(size[::-1])
    mean = _blurred(small, 0.0128 * side / 4) / max(float(small.mean()), 1e-4)
    dense = _blurred(ramps(mean, 0.75, 2.75), 0.024 * side / 4)
    full = cv2.resize(dense, (width, height), interpolation=cv2.INTER_LINEAR)
    return np.asarray(full, np.float32).reshape(height, width)


def small_lights(greatest: Float32) -> Float32:
    """How far each pixel belongs to a small light in dark surroundings: (H, W) in [0, 1].

    It is brighter than what a morphological opening leaves around it by 2 stops (0) to 3.5 (1).
    """
    side = max(3, 2 * round(0.02 * math.sqrt(greatest.size)) + 1)
    around = cv2.morphologyEx(greatest, cv2.MORPH_OPEN, np.ones((side, side), np.uint8))
    around = cv2.blur(around, (side, side)).reshape(greatest.shape)
    ratio = np.log2((greatest + np.float32(0.01)) / (around + np.float32(0.01)))
    alone = ramps(ratio, 2, 3.5) * ramps(greatest, 0.15, 0.4)
    wide = cv2.dilate(alone, np.ones((3, 3), np.uint8))
    return np.asarray(cv2.blur(wide, (3, 3)), np.float32).reshape(greatest.shape)


def _blurred(plane: Float32, sigma: float) -> Float32:
    blurred = cv2.GaussianBlur(plane, (0, 0), max(sigma, 0.3), borderType=cv2.BORDER_REFLECT)
    return np.asarray(blurred, np.float32).reshape(plane.shape)
