"""Maps brought to the picture's size: cv2.resize and a slow guided filter as oracles."""

from __future__ import annotations

import math

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from itmo_video.rendering.guided_upsampling import edge_aware_coefficients, upsample_rows

pytestmark = pytest.mark.usefixtures("loops")

Map = npt.NDArray[np.float32]


def upsample_bilinear(map_small: Map, shape_hw: tuple[int, int]) -> Map:
    """The oracle: a map brought up to (H, W) by OpenCV."""
    height, width = shape_hw
    return np.asarray(cv2.resize(map_small, (width, height)), np.float32)


def test_upsampling_keeps_constants_and_aligns_areas() -> None:
    up = upsample_rows(np.array([[0.0, 1.0]], np.float32), slice(0, 2), (2, 8))
    assert up.shape == (2, 8)
    assert up.dtype == np.float32
    expected = [0.0, 0.0, 0.125, 0.375, 0.625, 0.875, 1.0, 1.0]
    np.testing.assert_allclose(up[0], expected, atol=1e-6, err_msg="areas are not aligned")


def oracle_guided(
    map_small: Map, guide: Map, radius: int, epsilon: float
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """He et al. 2013, eq. 5, 6 and 8, window by window."""
    height, width = map_small.shape

    def window(image: npt.NDArray[np.floating], y: int, x: int) -> npt.NDArray[np.float64]:
        rows = slice(max(y - radius, 0), y + radius + 1)
        return image[rows, max(x - radius, 0) : x + radius + 1].astype(np.float64)

    a, b = np.zeros((height, width)), np.zeros((height, width))
    for y in range(height):
        for x in range(width):
            g, m = window(guide, y, x), window(map_small, y, x)
            a[y, x] = ((g * m).mean() - g.mean() * m.mean()) / (g.var() + epsilon)
            b[y, x] = m.mean() - a[y, x] * g.mean()
    means = [
        [(window(a, y, x).mean(), window(b, y, x).mean()) for x in range(width)]
        for y in range(height)
    ]
    both = np.array(means)
    return both[..., 0], both[..., 1]


@pytest.mark.parametrize("shape", [(1, 1), (2, 3), (12, 17)])
@pytest.mark.parametrize("radius", [0, 2, 5])
def test_edge_aware_coefficients_equal_the_oracle(shape: tuple[int, int], radius: int) -> None:
    rng = np.random.default_rng(2)
    map_small, guide = rng.random((2, *shape), dtype=np.float32)
    a, b = edge_aware_coefficients(map_small, guide, radius, 1e-2)
    expected_a, expected_b = oracle_guided(map_small, guide, radius, 1e-2)
    assert a.dtype == b.dtype == np.float32
    np.testing.assert_allclose(a, expected_a, atol=1e-4, err_msg="slope a")
    np.testing.assert_allclose(b, expected_b, atol=1e-4, err_msg="offset b")


def test_edge_aware_map_follows_the_guides_edge() -> None:
    guide_full = np.repeat(np.where(np.arange(64) < 33, 0.1, 0.9)[None], 48, axis=0)
    guide_full = guide_full.astype(np.float32)
    guide_small = guide_full.reshape(12, 4, 16, 4).mean(axis=(1, 3))
    blurred = np.tile(np.linspace(0.0, 1.0, 16, dtype=np.float32), (12, 1))
    a, b = edge_aware_coefficients(blurred, guide_small, 4, 1e-4)
    sharp = upsample_bilinear(a, (48, 64)) * guide_full + upsample_bilinear(b, (48, 64))
    plain = upsample_bilinear(blurred, (48, 64))
    step_sharp, step_plain = (float(m[24, 33] - m[24, 32]) for m in (sharp, plain))
    assert step_sharp > 10 * step_plain, "the map should jump where the guide does"


def test_edge_aware_map_of_a_flat_guide_is_a_blur_and_constants_stay() -> None:
    flat = np.full((9, 9), 0.5, np.float32)
    level = np.full((9, 9), 0.25, np.float32)
    a, b = edge_aware_coefficients(level, flat, 2, 1e-3)
    np.testing.assert_allclose(a * flat + b, level, atol=1e-6, err_msg="a constant map changed")


def test_edge_aware_refuses_what_it_cannot_do() -> None:
    square = np.ones((4, 4), np.float32)
    with pytest.raises(ValueError, match="shape"):
        edge_aware_coefficients(square, square[:3], 1, 1e-3)
    for radius, epsilon in ((-1, 1e-3), (1, 0.0), (1, math.nan)):
        with pytest.raises(ValueError, match="epsilon"):
            edge_aware_coefficients(square, square, radius, epsilon)


@pytest.mark.parametrize("shape", [(3, 2), (40, 70), (288, 512), (1, 1)])
def test_upsample_rows_equals_upsample_bilinear(shape: tuple[int, int]) -> None:
    small = np.random.default_rng(3).random((min(30, shape[0]), min(50, shape[1])), np.float32)
    full = upsample_bilinear(small, shape)
    for rows in (slice(0, shape[0]), slice(shape[0] // 2, shape[0])):
        strip = upsample_rows(small, rows, shape)
        np.testing.assert_allclose(strip, full[rows], atol=2e-6, err_msg=f"rows {rows}")
