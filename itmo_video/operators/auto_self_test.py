"""Tests the network on known light of the same picture, to see how far to trust it.

The picture is clipped again, lower, at TEST_WHITE. Light between there and white is then lost to
the network but known to us, and everything at white must come out brighter than it. If the network
cannot tell the two apart (large pale skies and walls that are hardly brighter than white), its
estimate of light above white is not reliable, either.
"""

from __future__ import annotations

import math

import numpy as np

from itmo_video.colour.analysis_picture import area_means
from itmo_video.colour.luminance import greatest_of
from itmo_video.model import Float32
from itmo_video.operators.auto_clipping import CLIPS_FROM, CLIPS_WHOLLY
from itmo_video.operators.auto_levels import expected_levels, level_shares
from itmo_video.operators.ramps import ramp, ramps

TEST_WHITE = 0.4  # of white, linear
TEST_WIDTH_PX = 240  # of the picture for the test
BETWEEN_FROM = 1.1  # times TEST_WHITE: light counts as between from here on
# Shares of the picture that are between, for which the test counts; with most of it between, it
# would be another picture.
FEW, ENOUGH, MANY, MOST = 0.01, 0.04, 0.5, 0.8
FAILED_STOPS, PASSED_STOPS = 0.15, 0.25  # by which white comes out brighter
LEAST_PASSED = 0.6
# Only if it predicts that clipped areas are hardly above white, so that SDR is near the truth.
LITTLE_STOPS, MUCH_STOPS = 0.3, 0.45


def self_test(rgb_linear: Float32, mean_stops: float, wrap_x: bool = False) -> float:
    """The share of the network's stops that is used for a picture: LEAST_PASSED to 1.

    `rgb_linear` is the picture at analysis size, float32 (H, W, 3) in [0, 1]; `mean_stops` the
    network's prediction for it (`auto_levels.mean_stops`); `wrap_x` for a panorama.
    """
    little = 1 - ramp(mean_stops, LITTLE_STOPS, MUCH_STOPS)
    if little == 0:
        return 1.0
    height, width = rgb_linear.shape[:2]
    if width > TEST_WIDTH_PX:
        size = TEST_WIDTH_PX, max(1, round(height * TEST_WIDTH_PX / width))
        rgb_linear = area_means(rgb_linear, size)
    greatest = greatest_of(rgb_linear)
    white = ramps(greatest, CLIPS_FROM, CLIPS_WHOLLY)
    between = ramps(greatest, TEST_WHITE, TEST_WHITE * BETWEEN_FROM) * (1 - white)
    share = float(between.mean())
    counts = ramp(share, FEW, ENOUGH) * (1 - ramp(share, MANY, MOST))
    if counts == 0 or not white.any():
        return 1.0
    shares = level_shares(np.minimum(rgb_linear * np.float32(1 / TEST_WHITE), 1), wrap_x)
    levels = greatest_of(expected_levels(shares, greatest.shape, 1 / TEST_WHITE, wrap_x))
    stops = levels * np.float32(math.log2(1 / TEST_WHITE))
    apart_stops = float(np.average(stops, weights=white) - np.average(stops, weights=between))
    failed = 1 - ramp(apart_stops, FAILED_STOPS, PASSED_STOPS)
    return 1 - (1 - LEAST_PASSED) * little * counts * failed
