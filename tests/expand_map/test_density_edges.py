"""The Expand Map at the edges of a picture and of what it takes: odd shapes, seams, far lights."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from lights import Map, blobs, lights_at, oracle_weight, random_lights

from itmo_video.expand_map.density import (
    density_map,
    density_map_soft,
    scaled_radius_px,
)
from itmo_video.expand_map.median_cut import Lights, median_cut

MapOf = Callable[..., Map]
BOTH = pytest.mark.parametrize("map_of", [density_map, density_map_soft])


@BOTH
def test_white_is_about_one_in_the_middle(map_of: MapOf) -> None:
    lights = median_cut(np.ones((32, 32), np.float32), 1024)  # a light on every pixel
    middle = map_of(lights, (32, 32), 5.0, 4)[6:-6, 6:-6]
    np.testing.assert_allclose(middle, 1.0, atol=1e-5, err_msg="white must have density 1")
    lights = median_cut(np.ones((288, 512), np.float32))
    middle = map_of(lights, (288, 512), 40.0, 4)[60:-60, 60:-60]
    np.testing.assert_allclose(middle, 1.0, atol=0.13, err_msg="also with few lights")


@BOTH
def test_black_is_nowhere_expanded(map_of: MapOf) -> None:
    lights = median_cut(np.zeros((30, 50), np.float32))
    assert not map_of(lights, (30, 50), 5.0, 1).any(), "black has no light"


@BOTH
@pytest.mark.parametrize("wrap_x", [False, True])
@pytest.mark.parametrize("shape", [(1, 1), (2, 3), (1, 40), (40, 1), (5, 4096)])
def test_odd_shapes(map_of: MapOf, shape: tuple[int, int], wrap_x: bool) -> None:
    for level in (0.0, 1.0):
        lights = median_cut(np.full(shape, level, np.float32), 64)
        for radius in (scaled_radius_px(16.0, shape[1], shape[0]), 7.5):
            dense = map_of(lights, shape, radius, 4, wrap_x)
            assert dense.shape == shape, f"level {level}, radius {radius}"
            assert dense.dtype == np.float32, f"level {level}, radius {radius}"
            assert dense.min() >= 0.0, f"level {level}, radius {radius}"
            assert dense.max() <= 1.0, f"level {level}, radius {radius}"


@BOTH
def test_range_and_clip(map_of: MapOf) -> None:
    lights = random_lights(20, 30, 200, 1)
    bright = lights._replace(power=lights.power * 1e4)
    dense = map_of(bright, (20, 30), 4.0, 4)
    assert dense.max() == 1.0, "bright lights saturate at exactly 1"
    assert dense.min() >= 0.0, "no negative weights"
    assert map_of(bright, (60, 30), 4.0, 1).min() >= 0.0, "no negative weights without threshold"


@BOTH
def test_wrap_x_rolls_with_the_picture(map_of: MapOf) -> None:
    lights = random_lights(24, 40, 150, 3)
    moved = lights._replace(x=(lights.x + 17) % 40)
    still = map_of(lights, (24, 40), 4.2, 4, True)
    rolled = map_of(moved, (24, 40), 4.2, 4, True)
    np.testing.assert_allclose(
        rolled, np.roll(still, 17, axis=1), atol=2e-6, err_msg="a panorama has no edge in x"
    )


@BOTH
def test_wrap_x_is_continuous_across_the_edge(map_of: MapOf) -> None:
    x = np.arange(256)
    picture = np.tile(np.where(np.minimum(x, 256 - x) < 40, 1.0, 0.01), (128, 1))
    lights = median_cut(picture, 512)
    open_map = map_of(lights, picture.shape, 9.0, 3, False)[20:-20]
    wrapped = map_of(lights, picture.shape, 9.0, 3, True)[20:-20]
    if map_of is density_map:  # the soft one leaves out what of the disc is not in the picture
        assert wrapped[:, [0, -1]].mean() > 1.3 * open_map[:, [0, -1]].mean(), "edge lost its light"
    middle = slice(20, -20)
    np.testing.assert_allclose(
        wrapped[:, middle], open_map[:, middle], atol=2e-5, err_msg="wrapping reached the middle"
    )
    across = np.abs(wrapped[:, 0] - wrapped[:, -1]).mean()
    inside = np.abs(np.diff(wrapped[:, :30], axis=1)).mean(axis=0).max()
    assert across <= 1.5 * inside + 1e-6, "a seam at the panorama's edge"


@BOTH
def test_wrap_x_counts_a_light_once_on_a_narrow_picture(map_of: MapOf) -> None:
    light = lights_at((1.0, 1.0, 1.0))
    dense = map_of(light, (3, 4), 2.0, 1, True)
    expected = oracle_weight(2.0, 2.0) / oracle_weight(0.0, 2.0)
    assert dense[1, 3] / dense[1, 1] == pytest.approx(expected, rel=1e-5), "counted from both sides"


def test_a_white_picture_is_as_expanded_at_its_edge_as_in_its_middle() -> None:
    lights = median_cut(np.ones((128, 192)), 1024)
    soft = density_map_soft(lights, (128, 192), 9.0, 1)
    assert soft[0].mean() == pytest.approx(soft[64].mean(), abs=0.05), "a dark rim"
    assert soft[0, 0] == pytest.approx(soft[64, 96], abs=0.15), "a dark corner"


@BOTH
def test_nothing_far_away_moves_the_map(map_of: MapOf) -> None:
    near = random_lights(40, 40, 60, 5)
    far = lights_at(*((70.0 + i % 5, 20.0, 50.0) for i in range(20)))
    both = Lights(*(np.concatenate([one, other]) for one, other in zip(near, far, strict=True)))
    alone = map_of(near, (40, 90), 5.0, 4)[:, :50]
    joined = map_of(both, (40, 90), 5.0, 4)[:, :50]
    np.testing.assert_allclose(joined, alone, atol=2e-5, err_msg="the map pumps")


def test_soft_map_looks_like_the_hard_one_and_moves_less() -> None:
    picture = blobs()
    lights = median_cut(picture)
    radius = scaled_radius_px(16.0, 256, 144)
    hard = density_map(lights, picture.shape, radius, 4)
    soft = density_map_soft(lights, picture.shape, radius, 4)
    assert np.corrcoef(hard.ravel(), soft.ravel())[0, 1] > 0.9, "soft and hard maps differ"
    shaken = lights._replace(x=np.clip(lights.x + 0.05, 0, 255))
    hard_change = np.abs(density_map(shaken, picture.shape, radius, 4) - hard).mean()
    soft_change = np.abs(density_map_soft(shaken, picture.shape, radius, 4) - soft).mean()
    assert soft_change < 0.5 * hard_change, "the soft map is there to move less"


def test_soft_map_is_continuous_in_the_lights() -> None:
    lights = random_lights(30, 30, 120, 7)
    base = density_map_soft(lights, (30, 30), 4.0, 4)
    for step in (1e-2, 1e-3, 1e-4):
        moved = density_map_soft(lights._replace(x=np.abs(lights.x - step)), (30, 30), 4.0, 4)
        assert np.abs(moved - base).max() < 5.0 * step + 1e-5, f"a jump at a move of {step} px"


@BOTH
def test_refuses_what_is_no_picture_or_radius(map_of: MapOf) -> None:
    light = lights_at((0.0, 0.0, 1.0))
    for shape, radius in (((0, 4), 1.0), ((4, 4), -1.0), ((4, 4), math.nan), ((4, 4), math.inf)):
        with pytest.raises(ValueError, match="radius"):
            map_of(light, shape, radius, 4)
