"""How far the channels of clipped areas may separate.

If one channel clips alone, the hue is lost: an orange sky turns yellow. Unclipped pixels nearby
still show that hue, so a channel may always rise until the colour nearby is restored; further only
where it is certain that it clips, and no further than the colour itself allows, as noise and
compression decide which pixel clips. Everything is an average of the analysis picture.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence

import cv2
import numpy as np

from itmo_video.colour.analysis_picture import area_means
from itmo_video.colour.luminance import greatest_of
from itmo_video.colour.primaries import LUMINANCE_WEIGHTS_BANTERLE2006
from itmo_video.kernels import compiled_near_white
from itmo_video.kernels.dispatch import with_compiled_form
from itmo_video.model import Float32
from itmo_video.operators.auto_clipping import (
    AROUND_PX,
    CLIPS_FROM,
    CLIPS_WHOLLY,
    LEAST_BRIGHT,
    NEAR_FROM,
    NEAR_WHOLLY,
    blurred,
)
from itmo_video.operators.ramps import ramps

FAR_AROUND_PX = 7.0  # standard deviation
DECIDED_FROM, DECIDED_WHOLLY = 0.6, 0.95  # shares of what is bright around
APART_STOPS, APART_POWER = 0.5, 1.5  # of separation if the colour spans a stop
FREE_FROM, FREE_WHOLLY = 0.87, 1.0  # of white: the second highest channel nearby, when clipping
SHOWN_FROM, SHOWN_WHOLLY = 0.2, 0.5  # of white, linear: bright enough to show a colour
SHOWN_SHARE = 0.05  # of such pixels nearby is enough to know the colour
_SMALLER = 4  # wide averages are computed at this fraction of the size
_TRACE, _DARK = np.float32(1e-3), np.float32(1e-3)


def colour_of_bright(rgb_linear: Float32) -> Float32:
    """The mean colour of what is bright nearby, or the pixel's own if nothing is: (H, W, 3)."""
    bright, weighed = weighed_by_light(rgb_linear, NEAR_FROM, NEAR_WHOLLY)
    around, weight = blurred(weighed, AROUND_PX), blurred(bright, AROUND_PX)
    return mean_colour(around, rgb_linear, weight, float(_TRACE))


@with_compiled_form(compiled_near_white.weighed_by_light)
def weighed_by_light(rgb: Float32, low: float, high: float) -> tuple[Float32, Float32]:
    """`ramps` of the highest channel of each pixel, (H, W), and the picture times that."""
    weight = ramps(greatest_of(rgb), low, high)
    return weight, _joined([plane * weight for plane in _planes(rgb)])


@with_compiled_form(compiled_near_white.mean_colour)
def mean_colour(around: Float32, own: Float32, weight: Float32, trace: float) -> Float32:
    """The sums `around` over their `weight`, with a trace of the pixel's own colour: (H, W, 3)."""
    all_, little = weight + np.float32(trace), np.float32(trace)
    pairs = zip(_planes(around), _planes(own), strict=True)
    return _joined([(far + little * near) / all_ for far, near in pairs])


def colour_lost(rgb_linear: Float32, colour: Float32) -> Float32:
    """Stops by which each channel may rise to restore the colour nearby: (H, W, 3), at least 0.

    The colour nearby is that of pixels that are bright but below white; the pixel's own is its
    `colour_of_bright`. A channel lacks the smaller of its deficits relative to the two others, at
    most as many stops as the pixel's own channels span, so that a white sky between green leaves
    stays white; 0 where everything nearby is clipped or dark.
    """
    height, width = rgb_linear.shape[:2]
    size = _quarter(width, height)
    greatest = greatest_of(rgb_linear)
    shown = ramps(greatest, SHOWN_FROM, SHOWN_WHOLLY)
    shown *= 1 - ramps(greatest, NEAR_FROM, NEAR_WHOLLY)
    sigma = FAR_AROUND_PX / _SMALLER
    weight = blurred(area_means(shown, size), sigma)
    seen = area_means(_joined([plane * shown for plane in _planes(rgb_linear)]), size)
    own = [np.log2(np.maximum(plane, _DARK)) for plane in _planes(area_means(colour, size))]
    span = cv2.max(cv2.max(own[0], own[1]), own[2]) - cv2.min(cv2.min(own[0], own[1]), own[2])
    far = [np.log2(plane / (weight + _TRACE) + _DARK) for plane in _planes(blurred(seen, sigma))]
    short = [there - here for there, here in zip(far, own, strict=True)]
    most = span * np.minimum(weight * np.float32(1 / SHOWN_SHARE), 1)
    lost = [np.clip(short[i] - cv2.max(short[i - 1], short[i - 2]), 0, most) for i in range(3)]
    full = cv2.resize(_joined(lost), (width, height), interpolation=cv2.INTER_LINEAR)
    return np.asarray(full, np.float32).reshape(height, width, 3)


def _compiled_parting(
    loaded: ctypes.CDLL, levels: Float32, colour: Float32, lost: Float32, peak_stops: float
) -> Float32:
    apart, free = APART_STOPS / max(peak_stops, 1e-6), (FREE_FROM, FREE_WHOLLY)
    return compiled_near_white.bounded_parting(
        loaded, levels, colour, lost, apart, free, float(_DARK)
    )


@with_compiled_form(_compiled_parting)
def bounded_parting(levels: Float32, colour: Float32, lost: Float32, peak_stops: float) -> Float32:
    """Levels of R, G and B, separated no further than the colour allows: float32 (H, W, 3).

    Where one channel alone clips, by APART_STOPS times the stops between the highest and the lowest
    channel of `colour_of_bright`, to the power of APART_POWER (a pale sky keeps its blue, while an
    orange sky's red is restored), or by what is `lost` if that is more. Where the second channel
    clips, too, the colour is unknown and there is no limit. Levels and `lost` are relative to
    `peak_stops`, log2 L'max.
    """
    # By planes: NumPy along an axis of three takes ten times as long.
    red, green, blue = _planes(colour)
    greatest, least = cv2.max(cv2.max(red, green), blue), cv2.min(cv2.min(red, green), blue)
    second = red + green + blue - greatest - least
    span_stops = np.log2(np.maximum(greatest, _DARK) / np.maximum(least, _DARK))
    most = np.float32(APART_STOPS / max(peak_stops, 1e-6)) * span_stops**APART_POWER
    known = _planes(levels)
    common = cv2.min(cv2.min(known[0], known[1]), known[2])
    free = ramps(second, FREE_FROM, FREE_WHOLLY)
    bounded = []
    for plane, short in zip(known, _planes(lost), strict=True):
        parted = plane - common
        held = np.minimum(parted, cv2.max(most, short))
        bounded.append(common + held + free * (parted - held))
    return _joined(bounded)


def decided_together(stops: Float32, rgb_linear: Float32, lost: Float32) -> Float32:
    """Stops of R, G and B that differ freely only where it is certain which clip: (H, W, 3).

    Where no channel clips throughout, they keep the estimated luminance-weighted mean and differ by
    at most what is `lost` (`colour_lost`, in the unit of `stops`). All are (H, W, 3).
    """
    height, width = rgb_linear.shape[:2]
    size = _quarter(width, height)
    bright = area_means(ramps(greatest_of(rgb_linear), NEAR_FROM, NEAR_WHOLLY), size)
    clips = area_means(ramps(rgb_linear, CLIPS_FROM, CLIPS_WHOLLY), size)
    sigma = FAR_AROUND_PX / _SMALLER
    share = greatest_of(blurred(clips, sigma)) / (blurred(bright, sigma) + np.float32(LEAST_BRIGHT))
    share = cv2.resize(share, (width, height), interpolation=cv2.INTER_LINEAR)
    decided = ramps(
        np.asarray(share, np.float32).reshape(height, width), DECIDED_FROM, DECIDED_WHOLLY
    )
    return held_together(stops, lost, decided)


@with_compiled_form(compiled_near_white.held_together)
def held_together(stops: Float32, lost: Float32, decided: Float32) -> Float32:
    """Stops that differ by at most what is `lost` where `decided`, (H, W), is 0; freely at 1."""
    own = _planes(stops)
    common = cv2.min(cv2.min(own[0], own[1]), own[2])
    little = [
        np.minimum(plane - common, short) for plane, short in zip(own, _planes(lost), strict=True)
    ]
    even = _luminance(own) - _luminance(little)
    return _joined(
        [
            even + part + decided * (plane - even - part)
            for plane, part in zip(own, little, strict=True)
        ]
    )


def _luminance(planes: Sequence[Float32]) -> Float32:
    red, green, blue = (
        np.float32(w) * p for w, p in zip(LUMINANCE_WEIGHTS_BANTERLE2006, planes, strict=True)
    )
    return np.asarray(red + green + blue, np.float32)


def _quarter(width: int, height: int) -> tuple[int, int]:
    return max(1, width // _SMALLER), max(1, height // _SMALLER)


def _planes(rgb: Float32) -> list[Float32]:
    return [np.asarray(plane, np.float32).reshape(rgb.shape[:2]) for plane in cv2.split(rgb)]


def _joined(planes: Sequence[Float32]) -> Float32:
    return np.asarray(cv2.merge(planes), np.float32).reshape(*planes[0].shape, len(planes))
