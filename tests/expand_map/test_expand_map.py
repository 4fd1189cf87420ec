"""The Expand Map against slow oracles that follow docs/design.md word by word, and its laws."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lights import blobs, lights_at, oracle_weight, random_lights

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
        return np.asarray(density)
    count *= whole[1] / seen[1]
    start, end = max(min_lights - 2.1, 0.0), min_lights + 1.9
    ramp = np.clip((count - start) / (end - start), 0.0, 1.0)
    return np.asarray(density * (3.0 * ramp**2 - 2.0 * ramp**3))


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
