"""Where a picture is known to have clipped, and where its channels may depart from one another.

A channel that is at white in some pixels and a code or two below it in others shows that the light
is about white, not how far above; noise and compression decide which pixel clips. So both are
determined by the share of clipped among bright pixels around: edges against the dark do not count,
and no pixel decides alone.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from itmo_video.colour.luminance import greatest_of
from itmo_video.model import Float32
from itmo_video.operators.ramps import ramps

CLIPS_FROM, CLIPS_WHOLLY = 0.95, 0.985  # of white, linear: compression lets clipped areas waver
NEAR_FROM, NEAR_WHOLLY = 0.8, 0.93  # of white, linear: bright; a channel that clips with the others
AROUND_PX, FAR_AROUND_PX = 2.5, 7.0  # standard deviations, of the analysis picture
KNOWN_FROM, KNOWN_WHOLLY = 0.1, 0.7  # shares of what is bright around
DECIDED_FROM, DECIDED_WHOLLY = 0.6, 0.95
APART_STOPS, APART_POWER = 0.5, 1.5  # that a channel may part where the colour spans a stop
FREE_FROM, FREE_WHOLLY = 0.87, 1.0  # of white, linear: the second channel around, which then clips
LUMINANCE = (0.213, 0.715, 0.072)


def known_clipped(rgb_linear: Float32) -> Float32:
    """Where each channel is known to have clipped: float32 (H, W, 3) in [0, 1].

    By the share of clipped among bright pixels of the channel, so that a single bright pixel of a
    wall is not a lamp, and compression leaves no holes in a white sky; neighbouring places count,
    too. Where one channel clips, channels near white count as clipped: a sky of (0.96, 0.99, 0.96)
    is white, and would turn green if only green were restored.
    """
    shape = rgb_linear.shape
    clips = ramps(rgb_linear, CLIPS_FROM, CLIPS_WHOLLY)
    share = _share(clips, ramps(rgb_linear, NEAR_FROM, NEAR_WHOLLY), AROUND_PX)
    known = cv2.dilate(ramps(share, KNOWN_FROM, KNOWN_WHOLLY), np.ones((3, 3), np.uint8))
    known = _blurred(known, 1).reshape(shape)
    near = ramps(cv2.blur(rgb_linear, (3, 3)).reshape(shape), NEAR_FROM, NEAR_WHOLLY)
    return np.asarray(np.maximum(known, near * greatest_of(known)[..., None]), np.float32)


def decided_together(stops: Float32, rgb_linear: Float32) -> Float32:
    """Stops of R, G and B that differ only where it is certain what clips: float32 (H, W, 3).

    Where no channel clips throughout, the luminance-weighted mean is used for all three: as bright
    as estimated, but without a colour shift. Both are (H, W, 3).
    """
    height, width = rgb_linear.shape[:2]
    size = (max(1, width // 4), max(1, height // 4))
    bright = _small(ramps(greatest_of(rgb_linear), NEAR_FROM, NEAR_WHOLLY), size)
    clips = _small(ramps(rgb_linear, CLIPS_FROM, CLIPS_WHOLLY), size)
    share = greatest_of(_share(clips, bright[..., None], FAR_AROUND_PX / 4))
    share = cv2.resize(share, (width, height), interpolation=cv2.INTER_LINEAR)
    share = np.asarray(share, np.float32).reshape(height, width, 1)
    decided = ramps(share, DECIDED_FROM, DECIDED_WHOLLY)
    mean = (stops @ np.array(LUMINANCE, np.float32))[..., None]
    return np.asarray(mean + decided * (stops - mean), np.float32)


def bounded_parting(levels: Float32, rgb_linear: Float32, peak_stops: float) -> Float32:
    """Levels of R, G and B that part no further than the colour around allows: float32 (H, W, 3).

    Where one channel alone clips, by APART_STOPS times the stops between the greatest and the least
    of what is bright around to the power of APART_POWER: a pale sky's blue that clips a little
    stays that sky's, an orange sky's red is restored. Where the second channel clips, too, it tells
    nothing of the colour, and there is no bound. Levels are over `peak_stops`, log2 L'max.
    """
    # By planes: NumPy along an axis of three takes ten times as long.
    bright = ramps(greatest_of(rgb_linear), NEAR_FROM, NEAR_WHOLLY)
    trace = np.float32(1e-3)  # where nothing is bright around, the place's own colour
    weight = _blurred(bright, AROUND_PX) + trace
    own = _planes(rgb_linear)
    around = _planes(_blurred(_joined([plane * bright for plane in own]), AROUND_PX))
    red, green, blue = (
        (far + trace * near) / weight for far, near in zip(around, own, strict=True)
    )
    greatest, least = cv2.max(cv2.max(red, green), blue), cv2.min(cv2.min(red, green), blue)
    second = red + green + blue - greatest - least
    dark = np.float32(1e-3)
    span_stops = np.log2(np.maximum(greatest, dark) / np.maximum(least, dark))
    most = np.float32(APART_STOPS / max(peak_stops, 1e-6)) * span_stops**APART_POWER
    known = _planes(levels)
    common = cv2.min(cv2.min(known[0], known[1]), known[2])
    free = ramps(second, FREE_FROM, FREE_WHOLLY)
    bounded = []
    for plane in known:
        parted = plane - common
        held = np.minimum(parted, most)
        bounded.append(common + held + free * (parted - held))
    return _joined(bounded)


def _planes(rgb: Float32) -> list[Float32]:
    return [np.asarray(plane, np.float32).reshape(rgb.shape[:2]) for plane in cv2.split(rgb)]


def _joined(planes: Sequence[Float32]) -> Float32:
    return np.asarray(cv2.merge(planes), np.float32).reshape(*planes[0].shape, len(planes))


def _share(clips: Float32, bright: Float32, sigma: float) -> Float32:
    """The share of clipped among bright pixels around, for each channel separately."""
    around = _blurred(bright, sigma) + np.float32(0.02)
    return np.asarray(_blurred(clips, sigma) / around, np.float32)


def _small(planes: Float32, size: tuple[int, int]) -> Float32:
    small = cv2.resize(planes, size, interpolation=cv2.INTER_AREA)
    return np.asarray(small, np.float32).reshape(*size[::-1], *planes.shape[2:])


def _blurred(planes: Float32, sigma: float) -> Float32:
    taps = 2 * round(3 * sigma) + 1
    blurred = cv2.GaussianBlur(planes, (taps, taps), sigma, borderType=cv2.BORDER_REFLECT)
    return np.asarray(blurred, np.float32).reshape(planes.shape)
