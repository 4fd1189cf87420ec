"""The compiled gains of `auto` against their plain form."""

from __future__ import annotations

import numpy as np
import pytest
from compiled_kernels import ByLibraries, needs_kernels

from itmo_video.operators.auto import expand_auto, gain_auto
from itmo_video.operators.base import Context
from itmo_video.operators.ramps import ramps

# ---- maps and luminance (test_colour.py holds linear light against the equations) ----


@needs_kernels
@pytest.mark.parametrize("l_max", [2.0, 20.0, 300.0])
@pytest.mark.parametrize("is_weighed", [True, False])
def test_gain_auto(by_libraries: ByLibraries, is_weighed: bool, l_max: float) -> None:
    rng = np.random.default_rng(15)
    rgb = [(1.2 * rng.random((40, 131)) ** 3).astype(np.float32) for _ in range(3)]
    rgb[1][10:20] = rgb[0][10:20]
    for channel in rgb:
        channel[20:] *= 0.3  # nothing to open
    maps = [rng.random((40, 131), np.float32) for _ in range(4)] if is_weighed else []
    if is_weighed:
        maps[3][30:] = 0
    ratio = rng.uniform(0.5, 2, (40, 131)).astype(np.float32) if is_weighed else None
    for hue in ("restore", "keep"):
        context = Context(l_max, l_max, hue=hue)
        ours = gain_auto(rgb, ratio, maps, context)
        theirs = by_libraries(gain_auto, rgb, ratio, maps, context)
        for one, other in zip(ours, theirs, strict=True):
            np.testing.assert_allclose(one, other, rtol=2e-5)
            assert (one[30:] == 1).all()


@needs_kernels
@pytest.mark.parametrize("strength", [1.0, 0.6])
@pytest.mark.parametrize("curve", [0.0, 0.4, 1.0])  # of the greatest weight: none, by day, by night
def test_expand_auto_is_the_picture_times_its_gains(
    by_libraries: ByLibraries, curve: float, strength: float
) -> None:
    """In places where nothing, the curve alone, all channels alike or each its own rises."""
    rng = np.random.default_rng(16)
    rgb = [rng.uniform(0.2, 1, (12, 150)).astype(np.float32) for _ in range(3)]
    for top, most in ((0, 0.45), (3, 0.95), (6, 1)):
        for channel in rgb:
            channel[top : top + 3] *= np.float32(most)
    levels = [np.zeros((12, 150), np.float32)] + [rng.random((12, 150), np.float32)] * 2
    levels[1][9:] = levels[2][9:] = 0
    levels[0][2:9] = 0.5
    maps = [*levels, np.full((12, 150), curve, np.float32)]
    ratio = rng.uniform(0.5, 2, (12, 150)).astype(np.float32)
    context, found = Context(5, 5), []
    calls: tuple[ByLibraries, ...] = (lambda f, *a: f(*a), by_libraries)
    for call in calls:
        out = np.empty((3, 12, 150), np.float16)
        call(expand_auto, rgb, ratio, maps, context, strength, out)
        found.append(out)
        gains = call(gain_auto, rgb, ratio, maps, context)
        want = [p * ((g - 1) * np.float32(strength) + 1) for p, g in zip(rgb, gains, strict=True)]
        np.testing.assert_allclose(out, want, rtol=6e-4)
    apart = found[0].view(np.int16).astype(int) - found[1].view(np.int16)
    assert np.abs(apart).max() <= 1
    assert np.count_nonzero(apart) <= apart.size / 1000


@needs_kernels
def test_ramps_to_the_bit(by_libraries: ByLibraries) -> None:
    values = np.random.default_rng(18).uniform(-0.2, 1.2, (9, 70, 3)).astype(np.float32)
    ours = ramps(values, 0.8, 0.93)
    assert np.array_equal(ours, by_libraries(ramps, values, 0.8, 0.93))
    assert ours.min() == 0
    assert ours.max() == 1


@needs_kernels
def test_a_map_of_zero_may_be_one_number() -> None:
    rng = np.random.default_rng(17)
    rgb = [rng.random((9, 70), np.float32) for _ in range(3)]
    whole = [np.zeros((9, 70), np.float32), *rng.random((2, 9, 70), np.float32)]
    whole.append(np.zeros((9, 70), np.float32))
    single = [np.broadcast_to(np.float32(0), (9, 70)) if not m.any() else m for m in whole]
    for one, other in zip(
        gain_auto(rgb, None, whole, Context(5, 5)),
        gain_auto(rgb, None, single, Context(5, 5)),
        strict=True,
    ):
        assert np.array_equal(one, other)
