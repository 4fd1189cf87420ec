"""Pictures and headers for tests of EXR files and folders of them."""

from __future__ import annotations

import dataclasses
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from itmo_video.errors import InputError
from itmo_video.model import Half
from itmo_video.output import exr

REC709 = (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329)
HEADER = exr.ExrHeader(
    compression="zip",
    chromaticities=REC709,
    white_nits=203.0,
    frame_rate=Fraction(24000, 1001),
    pixel_aspect=Fraction(64, 45),
    time_s=Fraction(1001, 24000),
    source_name="Ein Film, 文 %04d: 1.mp4",
    fingerprint="0123abcd" * 8,
    timecode="01:02:03;04",
    settings_text="l_max = 4.93\nalpha = 'x'\n",
)


def header(**changes: Any) -> exr.ExrHeader:
    """HEADER with other fields."""
    return dataclasses.replace(HEADER, **changes)


def picture(height: int, width: int, seed: int = 0) -> tuple[Half, Half, Half]:
    """Smooth R, G, B up to about 8 with a little noise."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0:height, 0:width]
    red, green, blue = (
        (4 + 4 * np.sin(x / 23 + k) * np.cos(y / 17 - k) + 0.01 * rng.random((height, width)))
        .astype(np.float16)
        for k in range(3)
    )  # fmt: skip
    return red, green, blue


def is_whole(path: Path) -> bool:
    """Whether the file is there and all its channels can be read."""
    try:
        exr.read_exr(path)
    except InputError:
        return False
    return True
