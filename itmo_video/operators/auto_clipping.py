"""Where a picture certainly clips.

A channel that is at white in some pixels and a code or two below it in others shows light of about
white, and noise and compression decide which pixel clips. So it is determined by the share of
clipped among bright pixels nearby: edges against the dark do not count, and no pixel decides alone.
"""

from __future__ import annotations

import cv2
import numpy as np

from itmo_video.colour.luminance import greatest_of
from itmo_video.kernels import compiled_near_white
from itmo_video.kernels.dispatch import with_compiled_form
from itmo_video.model import Float32
from itmo_video.operators.ramps import ramps

CLIPS_FROM, CLIPS_WHOLLY = 0.95, 0.985  # of white, linear: compression lets clipped areas waver
NEAR_FROM, NEAR_WHOLLY = 0.8, 0.93  # of white, linear: bright; a channel that clips with the others
AROUND_PX = 2.5  # standard deviation, of the analysis picture
KNOWN_FROM, KNOWN_WHOLLY = 0.1, 0.7  # shares of what is bright around
LEAST_BRIGHT = 0.02  # of the surroundings, added to what is bright


def known_clipped(rgb_linear: Float32) -> Float32:
    """Where each channel has certainly clipped: float32 (H, W, 3) in [0, 1].

    By the share of clipped among bright pixels of the channel, so that a single bright pixel of a
    wall is not a lamp, and compression leaves no holes in a white sky; neighbouring places count,
    too. Where one channel clips, channels near white count as clipped: a sky of (0.96, 0.99, 0.96)
    is white, and would turn green if only green were restored.
    """
    shape = rgb_linear.shape
    clips = ramps(rgb_linear, CLIPS_FROM, CLIPS_WHOLLY)
    bright = blurred(ramps(rgb_linear, NEAR_FROM, NEAR_WHOLLY), AROUND_PX)
    clipped = blurred(clips, AROUND_PX)
    decided = share_ramps(clipped, bright, LEAST_BRIGHT, KNOWN_FROM, KNOWN_WHOLLY)
    known = blurred(cv2.dilate(decided, np.ones((3, 3), np.uint8)).reshape(shape), 1)
    return with_near(known, cv2.blur(rgb_linear, (3, 3)).reshape(shape), NEAR_FROM, NEAR_WHOLLY)


@with_compiled_form(compiled_near_white.share_ramps)
def share_ramps(part: Float32, all_: Float32, least: float, low: float, high: float) -> Float32:
    """`ramps` of `part` over (`all_` + `least`): the share of clipped among what is bright."""
    return ramps(np.asarray(part / (all_ + np.float32(least)), np.float32), low, high)


@with_compiled_form(compiled_near_white.with_near)
def with_near(known: Float32, around: Float32, low: float, high: float) -> Float32:
    """Each channel of `known`, or the greatest times `ramps` of `around` if that is more."""
    near = ramps(around, low, high)
    return np.asarray(np.maximum(known, near * greatest_of(known)[..., None]), np.float32)


def blurred(planes: Float32, sigma: float) -> Float32:
    """Each plane smoothed by a Gaussian of standard deviation `sigma`, in pixels; none below 0."""
    reach_px = round(3 * sigma)
    filled = np.flatnonzero(planes.reshape(len(planes), -1).max(1))
    if not filled.size:
        return np.zeros_like(planes)
    # Only rows that are reached by others than of 0, which most planes here are full of.
    rows = slice(max(0, int(filled[0]) - reach_px), int(filled[-1]) + reach_px + 1)
    taps = 2 * reach_px + 1
    band = cv2.GaussianBlur(planes[rows], (taps, taps), sigma, borderType=cv2.BORDER_REFLECT)
    if len(band) == len(planes):
        return np.asarray(band, np.float32).reshape(planes.shape)
    soft = np.zeros_like(planes)
    soft[rows] = band.reshape(soft[rows].shape)
    return soft
