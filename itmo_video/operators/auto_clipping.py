"""Where a picture certainly clips.

A channel that is at white in some pixels and a code or two below it in others shows light of about
white, and noise and compression decide which pixel clips. So it is determined by the share of
clipped among bright pixels nearby: edges against the dark do not count, and no pixel decides alone.
"""

from __future__ import annotations

import ctypes
import functools

import cv2
import numpy as np

from itmo_video.colour.luminance import greatest_of
from itmo_video.kernels import compiled_blur, compiled_near_white
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


def _compiled_blurred(loaded: ctypes.CDLL, planes: Float32, sigma: float) -> Float32:
    return compiled_blur.blurred(loaded, planes, _gaussian(sigma))


@with_compiled_form(_compiled_blurred)
def blurred(planes: Float32, sigma: float) -> Float32:
    """Each plane smoothed by a Gaussian of standard deviation `sigma`, in pixels."""
    taps = 2 * round(3 * sigma) + 1
    soft = cv2.GaussianBlur(planes, (taps, taps), sigma, borderType=cv2.BORDER_REFLECT)
    return np.asarray(soft, np.float32).reshape(planes.shape)


@functools.lru_cache(maxsize=8)
def _gaussian(sigma: float) -> Float32:
    """The weights of the middle and of one side."""
    weights = cv2.getGaussianKernel(2 * round(3 * sigma) + 1, sigma, cv2.CV_32F)
    return np.asarray(weights[round(3 * sigma) :].ravel(), np.float32)
