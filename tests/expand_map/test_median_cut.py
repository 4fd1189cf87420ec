"""Median cut against a slow oracle that follows docs/design.md word by word, and its laws."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from itmo_video.expand_map.median_cut import median_cut, quantise

Box = tuple[int, int, int, int]


def oracle_regions(units: list[list[int]], n_lights: int) -> list[Box]:
    """The regions by plain loops over whole numbers: every cut is tried, the first best wins."""

    def total(x0: int, y0: int, x1: int, y1: int) -> int:
        return sum(sum(row[x0:x1]) for row in units[y0:y1])

    regions: list[Box] = [(0, 0, len(units[0]), len(units))]
    rounds = n_lights.bit_length() - 1
    for _ in range(rounds):
        after: list[Box] = []
        for x0, y0, x1, y1 in regions:
            if (x1 - x0) * (y1 - y0) == 1:
                after.append((x0, y0, x1, y1))
                continue
            best: tuple[int, list[Box]] | None = None
            if x1 - x0 >= y1 - y0:
                choices = [[(x0, y0, x, y1), (x, y0, x1, y1)] for x in range(x0 + 1, x1)]
            else:
                choices = [[(x0, y0, x1, y), (x0, y, x1, y1)] for y in range(y0 + 1, y1)]
            for halves in choices:
                imbalance = abs(total(*halves[0]) - total(*halves[1]))
                if best is None or imbalance < best[0]:
                    best = imbalance, halves
            assert best is not None
            after.extend(best[1])
        regions = after
    return regions


def oracle_light(units: list[list[int]], region: Box) -> tuple[float, float, int]:
    x0, y0, x1, y1 = region
    power = moment_x = moment_y = 0
    for y in range(y0, y1):
        for x in range(x0, x1):
            power += units[y][x]
            moment_x += (x - x0) * units[y][x]
            moment_y += (y - y0) * units[y][x]
    if power == 0:
        return 0.5 * (x0 + x1 - 1), 0.5 * (y0 + y1 - 1), 0
    return x0 + float(moment_x) / float(power), y0 + float(moment_y) / float(power), power


def assert_is_oracle(luminance: npt.NDArray[np.floating], n_lights: int, what: str) -> None:
    units, unit = quantise(luminance)
    rows = [[int(value) for value in row] for row in units]
    lights = median_cut(luminance, n_lights)
    regions = oracle_regions(rows, n_lights)
    assert lights.regions.tolist() == [list(r) for r in regions], f"{what}: other regions"
    expected = [oracle_light(rows, region) for region in regions]
    assert lights.power.tolist() == [power * unit for *_, power in expected], f"{what}: powers"
    assert lights.x.tolist() == [x for x, *_ in expected], f"{what}: centroids in x"
    assert lights.y.tolist() == [y for _, y, _ in expected], f"{what}: centroids in y"


def random_picture(height: int, width: int, seed: int = 0) -> npt.NDArray[np.float32]:
    return np.random.default_rng(seed).random((height, width), dtype=np.float32) ** 3


CHECKER = (np.indices((24, 32)).sum(axis=0) % 2).astype(np.float32)
PICTURES = {
    "random": random_picture(27, 40),
    "random, tall": random_picture(41, 16),
    "constant": np.full((24, 36), 0.3, np.float32),
    "white square": np.ones((32, 32), np.float32),
    "checker": CHECKER,
    "stripes of black": np.kron(CHECKER[:6, :8], np.ones((4, 4), np.float32)),
    "eighths": np.round(random_picture(24, 32) * 8) / 8,
    "mostly black": (random_picture(24, 32) > 0.9).astype(np.float32),
    "black": np.zeros((24, 32), np.float32),
    "one lit pixel": np.eye(20, 30, k=7, dtype=np.float32) * (np.arange(20) == 9)[:, None],
    "huge range": random_picture(20, 30) ** np.float32(12) * np.float32(6e4),
    "1x1": np.full((1, 1), 0.5, np.float32),
    "3x2": random_picture(2, 3),
    "row": random_picture(1, 37),
    "column": random_picture(29, 1),
}


@pytest.mark.parametrize("name", PICTURES)
@pytest.mark.parametrize("n_lights", [1, 2, 64, 1024])
def test_equals_the_oracle_exactly(name: str, n_lights: int) -> None:
    assert_is_oracle(PICTURES[name], n_lights, f"{name}, {n_lights} lights")


@settings(max_examples=200, deadline=None)
@given(
    st.integers(1, 11),
    st.integers(1, 11),
    st.sampled_from([1, 2, 3, 255]),
    st.integers(0, 2**32 - 1),
    st.sampled_from([2, 8, 32]),
)
def test_equals_the_oracle_where_ties_are_many(
    height: int, width: int, levels: int, seed: int, n_lights: int
) -> None:
    codes = np.random.default_rng(seed).integers(0, levels + 1, (height, width))
    assert_is_oracle(codes / levels, n_lights, f"{width}x{height}, {levels} levels, seed {seed}")


def test_quantising_loses_nothing_of_binary_fractions() -> None:
    picture = np.round(random_picture(40, 60) * 65535) / 65536
    units, unit = quantise(picture)
    np.testing.assert_array_equal(units * unit, picture, "16-bit fractions must stay as they are")


def test_quantising_is_far_below_what_video_resolves() -> None:
    picture = random_picture(288, 512)
    units, unit = quantise(picture)
    assert np.abs(units * unit - picture).max() <= 2.0**-36, "error above half a unit of 2^-35"
    assert units.sum() * 512 < 2.0**63, "moments could overflow int64"


def test_a_large_picture_keeps_exact_sums() -> None:
    picture = np.ones((2048, 4096), np.float32)
    lights = median_cut(picture, 256)
    assert float(lights.power.sum()) == picture.size, "powers lost light on 4096x2048"
    assert set(lights.power.tolist()) == {picture.size / 256}, "a white picture splits evenly"


@settings(max_examples=40, deadline=None)
@given(
    st.integers(1, 40),
    st.integers(1, 40),
    st.integers(0, 2**32 - 1),
    st.sampled_from([1, 16, 256]),
)
def test_laws(height: int, width: int, seed: int, n_lights: int) -> None:
    picture = random_picture(height, width, seed)
    lights = median_cut(picture, n_lights)
    units, unit = quantise(picture)
    assert len(lights.x) <= min(n_lights, picture.size), "more lights than asked for, or pixels"
    assert float(lights.power.sum()) == float(units.sum() * unit), "powers do not sum to the total"
    assert float(lights.power.sum()) == pytest.approx(float(picture.sum(dtype=float)), rel=1e-9)
    cover = np.zeros(picture.shape, int)
    for x0, y0, x1, y1 in lights.regions:
        cover[y0:y1, x0:x1] += 1
    assert (cover == 1).all(), "regions do not tile the picture"
    x0, y0, x1, y1 = lights.regions.T
    assert (lights.x >= x0).all(), "a light left of its region"
    assert (lights.x <= x1 - 1).all(), "a light right of its region"
    assert (lights.y >= y0).all(), "a light above its region"
    assert (lights.y <= y1 - 1).all(), "a light below its region"


@pytest.mark.parametrize("exponent", [-40, -1, 1, 13])
def test_scaling_by_a_power_of_two_scales_powers_only(exponent: int) -> None:
    picture = random_picture(30, 50).astype(np.float64)
    one, other = median_cut(picture, 64), median_cut(picture * 2.0**exponent, 64)
    for name in ("x", "y", "regions"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), f"{name} moved")
    np.testing.assert_array_equal(one.power * 2.0**exponent, other.power, "powers do not scale")


def test_float32_and_float64_input_agree() -> None:
    picture = random_picture(30, 50)
    for one, other in zip(median_cut(picture), median_cut(picture.astype(float)), strict=True):
        np.testing.assert_array_equal(one, other, "the input's type changed the lights")


def test_lights_have_about_equal_power_on_a_smooth_picture() -> None:
    y, x = np.mgrid[0:144, 0:256]
    lights = median_cut(0.5 + 0.4 * np.sin(x / 40.0) * np.cos(y / 30.0), 64)
    assert lights.power.max() / lights.power.min() < 1.3, "median cut makes equal powers"


def test_a_median_by_hand() -> None:
    lights = median_cut(np.array([[1.0, 1.0, 2.0, 4.0]]), 4)
    assert lights.regions[:, [0, 2]].tolist() == [[0, 2], [2, 3], [3, 4]]
    assert lights.power.tolist() == [2.0, 2.0, 4.0]
    assert lights.x.tolist() == [0.5, 2.0, 3.0]


def test_row_weight_multiplies_rows() -> None:
    picture = random_picture(32, 64).astype(np.float64)
    latitude = (np.arange(32) + 0.5) / 32 * np.pi - np.pi / 2
    weight = np.cos(latitude)
    weighted = median_cut(picture, 64, weight)
    for one, other in zip(weighted, median_cut(picture * weight[:, None], 64), strict=True):
        np.testing.assert_array_equal(one, other, "row_weight is not a factor of luminance")
    plain = median_cut(picture, 64)
    assert np.abs(weighted.y - 15.5).mean() < np.abs(plain.y - 15.5).mean(), "poles should lose"


def test_the_order_is_that_of_the_cuts() -> None:
    few, many = median_cut(random_picture(30, 50), 4), median_cut(random_picture(30, 50), 8)
    x0, y0 = many.regions[::2, :2].T
    np.testing.assert_array_equal(few.regions[:, :2], np.column_stack((x0, y0)), "order changed")
    np.testing.assert_array_equal(few.power, many.power[::2] + many.power[1::2], "not halves")


@pytest.mark.parametrize("n_lights", [0, -2, 3, 1000])
def test_refuses_a_number_that_is_no_power_of_two(n_lights: int) -> None:
    with pytest.raises(ValueError, match="power of two"):
        median_cut(np.ones((4, 4)), n_lights)


@pytest.mark.parametrize("value", [np.nan, np.inf, -1e-3])
def test_refuses_values_outside_the_domain(value: float) -> None:
    picture = np.ones((4, 4))
    picture[2, 1] = value
    with pytest.raises(ValueError, match="finite and not negative"):
        median_cut(picture)


def test_refuses_wrong_shapes() -> None:
    with pytest.raises(ValueError, match="picture"):
        median_cut(np.ones((4, 4, 3)))
    with pytest.raises(ValueError, match="picture"):
        median_cut(np.ones((0, 4)))
    with pytest.raises(ValueError, match="row_weight"):
        median_cut(np.ones((4, 5)), 4, np.ones(5))


def test_all_of_float32_and_large_numbers_work() -> None:
    for value in (1e-45, 1e-30, 1e300):
        lights = median_cut(np.full((4, 4), value), 4)
        assert lights.x.tolist() == [0.5, 0.5, 2.5, 2.5], f"{value}: lights elsewhere"
        assert lights.power.tolist() == pytest.approx([4.0 * value] * 4, rel=1e-9, abs=0.0), value
