"""Where a picture certainly clips.

A channel that is at white in some pixels and a code or two below it in others shows light of about
white, and noise and compression decide which pixel clips. So it is determined by the share of
clipped among bright pixels nearby: edges against the dark do not count, and no pixel decides alone.
"""

from __future__ import annotations

import cv2
import numpy as np

from itmo_video.colour.luminance import greatest_of
from itmo_video.model import Float32
from itmo_video.operators.ramps import ramps

CLIPS_FROM, CLIPS_WHOLLY = 0.95, 0.985  # of white, linear: compression lets clipped areas waver
NEAR_FROM, NEAR_WHOLLY = 0.8, 0.93  # of white, linear: bright; a channel that clips with the others
AROUND_PX = 2.5  # standard deviation, of the analysis picture
KNOWN_FROM, KNOWN_WHOLLY = 0.1, 0.7  # shares of what is bright around


def known_clipped(rgb_linear: Float32) -> Float32:
    """Where each channel has certainly clipped: float32 (H, W, 3) in [0, 1].

    By the share of clipped among bright pixels of the channel, so that a single bright pixel of a
    wall is not a lamp, and compression leaves no holes in a white sky; neighbouring places count,
    too. Where one channel clips, channels near white count as clipped: a sky of (0.96, 0.99, 0.96)
    is white, and would turn green if only green were restored.
    """
    shape = rgb_linear.shape
    clips = ramps(rgb_linear, CLIPS_FROM, CLIPS_WHOLLY)
    share = share_of(clips, ramps(rgb_linear, NEAR_FROM, NEAR_WHOLLY), AROUND_PX)
    known = cv2.dilate(ramps(share, KNOWN_FROM, KNOWN_WHOLLY), np.ones((3, 3), np.uint8))
    known = blurred(known, 1).reshape(shape)
    near = ramps(cv2.blur(rgb_linear, (3, 3)).reshape(shape), NEAR_FROM, NEAR_WHOLLY)
    return np.asarray(np.maximum(known, near * greatest_of(known)[..., None]), np.float32)


def share_of(clips: Float32, bright: Float32, sigma: float) -> Float32:
    """The share of clipped among bright pixels nearby, for each channel."""
    around = blurred(bright, sigma) + np.float32(0.02)
    return np.asarray(blurred(clips, sigma) / around, np.float32)


def averaged(planes: Float32, size: tuple[int, int]) -> Float32:
    """Each plane of (H, W) or (H, W, C) area-averaged to (width, height)."""
    small = cv2.resize(planes, size, interpolation=cv2.INTER_AREA)
    return np.asarray(small, np.float32).reshape(*size[::-1], *planes.shape[2:])


def blurred(planes: Float32, sigma: float) -> Float32:
    """Each plane smoothed by a Gaussian of standard deviation `sigma`, in pixels."""
    taps = 2 * round(3 * sigma) + 1
    soft = cv2.GaussianBlur(planes, (taps, taps), sigma, borderType=cv2.BORDER_REFLECT)
    return np.asarray(soft, np.float32).reshape(planes.shape)
