"""Lights, maps and pictures for tests of the Expand Map."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from itmo_video.expand_map.density import (
    BETA,
    GAMMA,
)
from itmo_video.expand_map.median_cut import Lights

Map = npt.NDArray[np.float32]


def oracle_weight(distance: float, r_max: float) -> float:
    """Eq. 16 as printed; GAMMA where r_max is 0."""
    if r_max == 0.0:
        return GAMMA
    numerator = 1.0 - math.exp(-BETA * distance**2 / (2.0 * r_max**2))
    return GAMMA * (1.0 - numerator / (1.0 - math.exp(-BETA)))


def blobs(height: int = 144, width: int = 256) -> Map:
    """A dim scene with a few bright soft spots of different sizes."""
    y, x = np.mgrid[0:height, 0:width]
    picture = np.full((height, width), 0.02)
    for centre_x, centre_y, size in ((0.2, 0.3, 0.06), (0.6, 0.6, 0.12), (0.85, 0.2, 0.04)):
        square = (x - centre_x * width) ** 2 + (y - centre_y * height) ** 2
        picture += np.exp(-0.5 * square / (size * height) ** 2)
    return np.asarray(np.minimum(picture, 1.0), np.float32)


def lights_at(*places: tuple[float, float, float]) -> Lights:
    x, y, power = np.array(places, dtype=np.float64).T
    return Lights(x, y, power, np.zeros((len(x), 4), np.int32))


def random_lights(height: int, width: int, n: int, seed: int) -> Lights:
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(0, width - 1, n), rng.uniform(0, height - 1, n)
    whole = rng.random(n) < 0.2  # some on pixel centres and some together, as in real pictures
    x[whole], y[whole] = np.rint(x[whole]), np.rint(y[whole])
    return Lights(x, y, rng.uniform(0.0, 3.0, n), np.zeros((n, 4), np.int32))
