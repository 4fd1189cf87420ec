"""The Expand Map against slow oracles that follow docs/design.md word by word, and its laws."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from itmo_video.expand_map import density
from itmo_video.expand_map.density import (
    BETA,
    GAMMA,
    density_map,
    density_map_soft,
    kernel_weight,
    scaled_radius_px,
    white_density,
)
from itmo_video.expand_map.median_cut import Lights, median_cut

Map = npt.NDArray[np.float32]
MapOf = Callable[..., Map]
BOTH = pytest.mark.parametrize("map_of", [density_map, density_map_soft])


def oracle_weight(distance: float, r_max: float) -> float:
    """Eq. 16 as printed; GAMMA where r_max is 0."""
    if r_max == 0.0:
        return GAMMA
    numerator = 1.0 - math.exp(-BETA * distance**2 / (2.0 * r_max**2))
    return GAMMA * (1.0 - numerator / (1.0 - math.exp(-BETA)))


def oracle_white(radius: float) -> float:
    whole = range(-math.floor(radius), math.floor(radius) + 1)
    distances = [math.hypot(x, y) for y in whole for x in whole if x * x + y * y <= radius**2]
    return sum(oracle_weight(distance, radius) for distance in distances)


def oracle_distance_x(pixel_x: int, light_x: float, width: int, wrap_x: bool) -> float:
    distance = abs(pixel_x - light_x)
    return min(distance, width - distance) if wrap_x else distance


def oracle_map(
    lights: Lights, shape: tuple[int, int], radius: float, min_lights: float, wrap_x: bool
) -> npt.NDArray[np.float64]:
    """Eq. 17 over lights with d <= r_t, 0 below the threshold, over white's density, clipped."""
    height, width = shape
    density = np.zeros(shape)
    for y in range(height):
        for x in range(width):
            reached = []
            for light_x, light_y, power in zip(lights.x, lights.y, lights.power, strict=True):
                across = oracle_distance_x(x, light_x, width, wrap_x)
                if across**2 + (y - light_y) ** 2 <= radius**2:
                    reached.append((math.hypot(across, y - light_y), power))
            if reached and len(reached) >= min_lights:
                r_max = max(distance for distance, _ in reached)
                density[y, x] = sum(power * oracle_weight(d, r_max) for d, power in reached)
    return np.minimum(density / oracle_white(radius), 1.0)


def oracle_soft(
    lights: Lights, shape: tuple[int, int], radius: float, min_lights: float, wrap_x: bool
) -> npt.NDArray[np.float64]:
    """Each light as up to four pixels, eq. 16 at r_max = r_t, soft-edged count, smooth ramp.

    Both sums over the share of their disc that lies in the picture.
    """
    height, width = shape
    edge = max(1.0, 0.15 * radius)
    density, count = np.zeros(shape), np.zeros(shape)
    room_y = min(math.ceil(radius + 0.5 * edge), height - 1)
    room_x = min(math.ceil(radius + 0.5 * edge), width // 2 if wrap_x else width - 1)
    whole, seen = np.zeros(2), np.zeros((2, *shape))
    for dy in range(-room_y, room_y + 1):
        # Where a panorama's two ends are the same column, it counts once.
        for dx in range(-room_x + (wrap_x and width % 2 == 0 and room_x == width // 2), room_x + 1):
            distance = math.hypot(dx, dy)
            weight = oracle_weight(distance, radius) if dx**2 + dy**2 <= radius**2 else 0.0
            weights = np.array([weight, min(max((radius - distance) / edge + 0.5, 0.0), 1.0)])
            whole += weights
            for y in range(max(0, -dy), min(height, height - dy)):
                columns = slice(None) if wrap_x else slice(max(0, -dx), min(width, width - dx))
                seen[:, y, columns] += weights[:, None]
    for light_x, light_y, power in zip(lights.x, lights.y, lights.power, strict=True):
        left, top = math.floor(light_x), math.floor(light_y)
        for at_x in (left, left + 1):
            for at_y in (top, top + 1):
                share = (1.0 - abs(light_x - at_x)) * (1.0 - abs(light_y - at_y))
                for y in range(height):
                    for x in range(width):
                        across = oracle_distance_x(x, at_x, width, wrap_x)
                        distance = math.hypot(across, y - at_y)
                        if across**2 + (y - at_y) ** 2 <= radius**2:
                            density[y, x] += share * power * oracle_weight(distance, radius)
                        inside = (radius - distance) / edge + 0.5
                        count[y, x] += share * min(max(inside, 0.0), 1.0)
    density = np.minimum(density / oracle_white(radius) * whole[0] / seen[0], 1.0)
    if min_lights <= 1:
        return density
    count *= whole[1] / seen[1]
    start, end = max(min_lights - 2.1, 0.0), min_lights + 1.9
    ramp = np.clip((count - start) / (end - start), 0.0, 1.0)
    return density * (3.0 * ramp**2 - 2.0 * ramp**3)


def blobs(height: int = 144, width: int = 256) -> Map:
    """A dim scene with a few bright soft spots of different sizes."""
    y, x = np.mgrid[0:height, 0:width]
    picture = np.full((height, width), 0.02)
    for centre_x, centre_y, size in ((0.2, 0.3, 0.06), (0.6, 0.6, 0.12), (0.85, 0.2, 0.04)):
        square = (x - centre_x * width) ** 2 + (y - centre_y * height) ** 2
        picture += np.exp(-0.5 * square / (size * height) ** 2)
    return np.minimum(picture, 1.0).astype(np.float32)


def lights_at(*places: tuple[float, float, float]) -> Lights:
    x, y, power = np.array(places, dtype=np.float64).T
    return Lights(x, y, power, np.zeros((len(x), 4), np.int32))


def random_lights(height: int, width: int, n: int, seed: int) -> Lights:
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(0, width - 1, n), rng.uniform(0, height - 1, n)
    whole = rng.random(n) < 0.2  # some on pixel centres and some together, as in real pictures
    x[whole], y[whole] = np.rint(x[whole]), np.rint(y[whole])
    return Lights(x, y, rng.uniform(0.0, 3.0, n), np.zeros((n, 4), np.int32))


def test_radius_is_the_papers_on_the_papers_size() -> None:
    assert scaled_radius_px(16.0, 512, 768) == 16.0
    assert scaled_radius_px(16.0, 768, 512) == 16.0
    assert scaled_radius_px(16.0, 512, 288) == pytest.approx(9.798, abs=1e-3)
    assert scaled_radius_px(8.0, 1024, 1536) == 16.0, "the radius goes with the root of the area"


def test_kernel_weight_closed_forms() -> None:
    assert float(kernel_weight(0.0, 5.0)) == pytest.approx(GAMMA), "w(0) is gamma"
    edge = GAMMA * (1 - (1 - math.exp(-BETA / 2)) / (1 - math.exp(-BETA)))
    assert float(kernel_weight(5.0, 5.0)) == pytest.approx(edge), "w(r_max), eq. 16"
    assert edge == pytest.approx(0.2511, abs=1e-4), "the paper's numbers"
    assert float(kernel_weight(0.0, 0.0)) == pytest.approx(GAMMA), "r_max 0 has weight gamma"


def test_kernel_weight_is_eq_16_falls_and_knows_only_the_ratio() -> None:
    distance = np.linspace(0.0, 7.0, 50)
    weight = kernel_weight(distance, 7.0)
    np.testing.assert_allclose(weight, [oracle_weight(d, 7.0) for d in distance], rtol=1e-13)
    assert (np.diff(weight) < 0).all(), "weights must fall with distance"
    np.testing.assert_allclose(kernel_weight(distance * 3, 21.0), weight, rtol=1e-13)


@pytest.mark.parametrize("radius", [0.0, 0.4, 1.0, 1.5, 5.0, 9.8, 16.0])
def test_white_density_is_the_sum_over_a_disc(radius: float) -> None:
    assert white_density(radius) == pytest.approx(oracle_white(radius), rel=1e-12)


def test_white_density_approaches_the_integral() -> None:
    k = 1.0 - math.exp(-BETA)
    mean = GAMMA * (1.0 - 1.0 / k + 2.0 / BETA * (1.0 - math.exp(-BETA / 2.0)) / k)
    assert white_density(200.0) == pytest.approx(mean * math.pi * 200.0**2, rel=1e-3)


@settings(max_examples=150, deadline=None)
@given(
    height=st.integers(1, 12),
    width=st.integers(1, 14),
    n=st.integers(1, 30),
    seed=st.integers(0, 2**32 - 1),
    radius=st.sampled_from([0.0, 0.3, 1.0, 1.7, 2.5, 4.0, 30.0]),
    min_lights=st.sampled_from([0, 1, 2, 4, 6]),
    wrap_x=st.booleans(),
)
def test_density_map_equals_the_oracle(
    height: int, width: int, n: int, seed: int, radius: float, min_lights: int, wrap_x: bool
) -> None:
    lights = random_lights(height, width, n, seed)
    expected = oracle_map(lights, (height, width), radius, min_lights, wrap_x)
    fast = density_map(lights, (height, width), radius, min_lights, wrap_x)
    np.testing.assert_allclose(fast, expected, atol=1e-6, rtol=0, err_msg="not design.md's map")


@settings(max_examples=60, deadline=None)
@given(
    height=st.integers(1, 8),
    width=st.integers(1, 9),
    n=st.integers(1, 12),
    seed=st.integers(0, 2**32 - 1),
    radius=st.sampled_from([0.0, 0.3, 1.0, 2.5, 4.0, 30.0]),
    min_lights=st.sampled_from([0, 1, 2, 4, 6]),
    wrap_x=st.booleans(),
)
def test_density_map_soft_equals_the_oracle(
    height: int, width: int, n: int, seed: int, radius: float, min_lights: int, wrap_x: bool
) -> None:
    lights = random_lights(height, width, n, seed)
    expected = oracle_soft(lights, (height, width), radius, min_lights, wrap_x)
    fast = density_map_soft(lights, (height, width), radius, min_lights, wrap_x)
    np.testing.assert_allclose(fast, expected, atol=2e-5, rtol=0, err_msg="not the soft map")


def test_density_map_equals_the_oracle_on_a_median_cut() -> None:
    picture = blobs(36, 64)
    lights = median_cut(picture, 128)
    expected = oracle_map(lights, picture.shape, 4.3, 4, False)
    fast = density_map(lights, picture.shape, 4.3, 4)
    assert 0.05 < (expected > 0).mean() < 0.9, "the scene should pass the threshold in places"
    np.testing.assert_allclose(fast, expected, atol=1e-6, rtol=0)


def test_memory_bound_parts_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    lights = median_cut(blobs(), 256)
    whole = density_map(lights, (144, 256), 9.0, 4)
    monkeypatch.setattr(density, "_MAX_PAIRS", 5000)
    parts = density_map(lights, (144, 256), 9.0, 4)
    np.testing.assert_allclose(parts, whole, atol=1e-6, rtol=0, err_msg="parts differ from whole")


def test_one_light_by_hand() -> None:
    light = lights_at((5.0, 4.0, 2.0))
    dense = density_map(light, (9, 11), 3.0, 1) * white_density(3.0)
    assert dense[4, 5] == pytest.approx(2.0 * GAMMA, rel=1e-6), "on the light: r_max 0, gamma"
    edge = 2.0 * oracle_weight(1.0, 1.0)
    assert dense[4, 8] == pytest.approx(edge, rel=1e-6), "r_max is the light's own distance"
    assert dense[4, 9] == 0.0, "beyond the radius"
    assert not density_map(light, (9, 11), 3.0, 2).any(), "one light is below two"


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
    both = Lights(*(np.concatenate(pair) for pair in zip(near, far, strict=True)))
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
