"""Luminance and small RGB of frames: strip by strip the same as of the whole picture."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from clips import film_encoding

from itmo_video.colour.analysis_picture import averaged
from itmo_video.colour.linear_light import to_rgb_linear
from itmo_video.colour.luminance import frame_luminance, frame_rgb_small
from itmo_video.model import Frame

pytestmark = pytest.mark.usefixtures("loops")


def noise(width: int, height: int) -> Frame:
    rng = np.random.default_rng(0)
    luma = rng.integers(16, 236, (height, width), np.uint8)
    chroma = rng.integers(16, 241, (2, -(-height // 2), -(-width // 2)), np.uint8)
    encoding = film_encoding()
    return Frame(0, Fraction(0), (luma, *chroma), encoding)


@pytest.mark.parametrize("size", [(640, 362), (320, 180), (321, 181), (1000, 562), (64, 130)])
@pytest.mark.parametrize("small", [(160, 90), (60, 34)])
def test_small_rgb_is_the_average_of_the_whole_picture(
    size: tuple[int, int], small: tuple[int, int]
) -> None:
    small = min(small[0], size[0]), min(small[1], size[1])
    frame = noise(*size)
    whole = [averaged(np.ascontiguousarray(p), small) for p in to_rgb_linear(frame, clip=True)]
    got = frame_rgb_small(frame, small)
    assert got.dtype == np.float32
    np.testing.assert_array_equal(
        got, np.clip(np.stack(whole, axis=-1), 0, 1), err_msg="halved by strips it differs"
    )


def test_luminance_is_equation_1() -> None:
    frame = noise(50, 70)
    red, green, blue = to_rgb_linear(frame, clip=True)
    expected = 0.213 * red + 0.715 * green + 0.072 * blue
    np.testing.assert_allclose(frame_luminance(frame), expected, atol=1e-6)
