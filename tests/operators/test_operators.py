"""Operators against closed forms: end points, slopes, round trips, monotone."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from itmo_video.errors import UsageError
from itmo_video.operators import (
    OPERATORS,
    Context,
    FrameStats,
    LuminanceOperator,
    Operator,
    auto,
    find_operator,
    geometric_mean,
    resolve_params,
)
from itmo_video.settings import Settings

RAMP = np.linspace(0, 1, 4097, dtype=np.float32)
STATS = FrameStats(0.0, 1.0, 0.1, 0.5, 0.01, 0.8)
HAS_ITS_OWN_PEAK = {"bt2446c", "ward1994"}  # absolute: L'max only limits them


def context(name: str, l_max: float = 20, l_white: float | None = None, **given: float) -> Context:
    params = resolve_params(OPERATORS[name], given)
    return Context(l_max, l_white if l_white is not None else l_max, params, stats=STATS)


def gain_of(name: str, luminance: Any, ctx: Context) -> Any:
    """An operator's gain of grey where its map is 1."""
    operator = OPERATORS[name]
    if isinstance(operator, LuminanceOperator):
        return operator.gain(luminance, ctx)
    rows = luminance[None]  # an operator may look at a pixel's neighbours
    return operator.gains([rows] * 3, None, [], ctx, 1.0)[0][0]


def curve_auto(luminance: Any, context: Context) -> Any:
    """`auto`'s expanded grey in float64 where all that clips goes to L'max: no maps."""

    def share(light: Any) -> Any:
        return 1 / (1 + np.exp(-auto.OPEN_SLOPE * (light - auto.OPEN_CENTRE)))

    low, white = share(auto.OPEN_FROM), share(1.0)
    gate = np.clip((share(luminance) - low) / (white - low), 0, None)
    return luminance * context.l_max**gate


def curve(name: str, luminance: Any, l_max: float = 20, **given: float) -> Any:
    operator = OPERATORS[name]
    function = operator.curve if isinstance(operator, LuminanceOperator) else curve_auto
    assert function is not None, f"{name} has no float64 reference"
    return function(np.asarray(luminance, np.float64), context(name, l_max, **given))


@pytest.mark.parametrize("name", sorted(OPERATORS))
@pytest.mark.parametrize("l_max", [1.0, 4.93, 20.0, 1000.0])
def test_white_becomes_l_max_and_nothing_is_infinite(name: str, l_max: float) -> None:
    gain = gain_of(name, RAMP, context(name, l_max))
    assert gain.dtype == np.float32
    assert np.isfinite(gain).all(), f"{name} is infinite somewhere"
    assert gain.min() >= 0, f"{name} makes light negative"
    if name in HAS_ITS_OWN_PEAK:
        assert (gain * RAMP).max() <= l_max * (1 + 1e-5), f"{name} passes the maximum"
    else:
        assert gain[-1] == pytest.approx(l_max, rel=1e-5), f"{name} does not end at the maximum"


@pytest.mark.parametrize("name", sorted(OPERATORS))
@pytest.mark.parametrize("l_max", [4.93, 20.0, 1000.0])
def test_expansion_is_monotone(name: str, l_max: float) -> None:
    expanded = curve(name, np.linspace(0, 1, 4097), l_max)
    assert expanded[0] == pytest.approx(0, abs=1e-9), f"{name} lifts black"
    rises = np.diff(expanded[expanded < l_max * (1 - 1e-12)]) > 0
    assert rises.all(), f"{name} maps a brighter pixel to a darker one"
    assert (np.diff(gain_of(name, RAMP, context(name, l_max)) * RAMP) >= 0).all()


@pytest.mark.parametrize("name", sorted(OPERATORS))
@pytest.mark.parametrize("l_max", [1.0, 4.93, 200.0])
def test_float32_gains_agree_with_the_float64_curves(name: str, l_max: float) -> None:
    luminance = RAMP[RAMP > 1e-3]
    got = gain_of(name, luminance, context(name, l_max)) * luminance.astype(np.float64)
    np.testing.assert_allclose(got, curve(name, luminance, l_max), rtol=2e-5, err_msg=name)


@pytest.mark.parametrize("name", sorted(OPERATORS))
def test_a_gain_is_a_new_array(name: str) -> None:
    luminance = RAMP.copy()
    gain = gain_of(name, luminance, context(name))
    gain *= 0
    assert (luminance == RAMP).all(), f"{name} hands out its input, which rendering overwrites"


@given(st.floats(0.001, 1.0), st.floats(1.0, 500.0), st.floats(0.5, 500.0))
def test_eq11_is_the_inverse_of_eq7(l_d: float, l_max: float, l_white: float) -> None:
    """Eq. 7 of the expanded luminance, scaled by alpha / mean of eq. 13, gives L_d back."""
    gain = gain_of(
        "banterle2006", np.array([l_d], np.float32), context("banterle2006", l_max, l_white)
    )
    l_d32 = float(np.float32(l_d))
    l_m = l_d32 * float(gain[0]) * l_white / l_max
    forward = l_m * (1 + l_m / l_white**2) / (1 + l_m)
    assert forward == pytest.approx(l_d32, rel=2e-5)


@given(st.floats(0.0, 1.0), st.floats(1.0, 300.0), st.floats(0.5, 300.0))
def test_gain_equals_the_solved_formula_in_float64(
    l_d: float, l_max: float, l_white: float
) -> None:
    luminance = np.array([max(l_d, 1e-3)], np.float32)
    l64 = float(luminance[0])
    root = np.sqrt((1 - l64) ** 2 + 4 * l64 / l_white**2)
    expected = l_max * l_white / 2 * (l64 - 1 + root)
    got = float(gain_of("banterle2006", luminance, context("banterle2006", l_max, l_white))[0])
    assert got * l64 == pytest.approx(expected, rel=1e-4)


def test_slope_at_black_is_l_max_over_l_white() -> None:
    gain = gain_of("banterle2006", RAMP, context("banterle2006", 20, 10))
    assert gain[0] == pytest.approx(2.0, rel=1e-6)


def test_a_given_alpha_counts_with_the_geometric_mean() -> None:
    """Eq. 12: L'max = L_white * mean / alpha."""
    luminance = np.array([1.0], np.float32)
    given_alpha = Context(999, 10, {}, alpha=0.18, geometric_mean=0.09)
    assert gain_of("banterle2006", luminance, given_alpha)[0] == pytest.approx(5.0)
    reinhard = gain_of(
        "reinhard2002",
        np.array([0.5], np.float32),
        Context(1e6, 10, {}, alpha=0.18, geometric_mean=0.09),
    )
    assert reinhard[0] * 0.5 == pytest.approx(0.5 * 0.09 / (0.5 * 0.18), rel=1e-4)


def test_geometric_mean_of_constants() -> None:
    assert geometric_mean(np.full((3, 2), 0.25, np.float32), 0.0) == pytest.approx(0.25)
    assert geometric_mean(np.zeros((3, 2), np.float32)) == pytest.approx(1e-3)


def test_landis_leaves_what_is_below_the_threshold() -> None:
    gain = gain_of("landis2002", RAMP, context("landis2002"))
    assert (gain[RAMP <= 0.5] == 1).all()
    assert (gain[RAMP > 0.501] > 1).all()


def test_unknown_operators_and_parameters_are_refused() -> None:
    with pytest.raises(UsageError, match="unknown operator"):
        find_operator(Settings(operator="nope"))
    with pytest.raises(UsageError, match="does not use alpha"):
        find_operator(Settings(operator="linear", alpha=0.18))
    with pytest.raises(UsageError, match="no parameter"):
        resolve_params(OPERATORS["linear"], {"x": 1})
    with pytest.raises(UsageError, match="threshold must be"):
        resolve_params(OPERATORS["landis2002"], {"threshold": 2})


@pytest.mark.parametrize("name", sorted(OPERATORS))
def test_every_operator_is_one_by_the_protocol(name: str) -> None:
    operator = OPERATORS[name]
    assert isinstance(operator, Operator)
    shape = (24, 36, 3) if operator.sees == "rgb" else (24, 36)
    picture = np.full(shape, 0.4, np.float32)
    ctx = replace(context(name), density=lambda luminance: luminance * 0 + 1)
    key_map = operator.map(picture, ctx)
    assert key_map.dtype == np.float32
    assert key_map.shape[:2] == (24, 36)
    planes = [key_map] if key_map.ndim == 2 else [key_map[..., i].copy() for i in range(4)]
    rgb = [np.full((24, 36), level, np.float32) for level in (0.4, 0.5, 1.0)]
    for maps, strength in ((planes, 1.0), ([], 1.0), (planes, 0.3)):
        gains = operator.gains(rgb, None, maps, ctx, strength)
        assert len(gains) in (1, 3)
        assert all(gain.dtype == np.float32 and gain.shape == (24, 36) for gain in gains)
    unchanged = operator.gains(rgb, None, planes, ctx, 0.0)
    assert all((gain == 1).all() for gain in unchanged), "no strength is no expansion"
    assert [plane[0, 0] for plane in rgb] == [np.float32(0.4), np.float32(0.5), 1.0]


def test_the_expand_map_is_there_only_while_a_map_is_made() -> None:
    with pytest.raises(ValueError, match="while a map is computed"):
        context("linear").expand_map(RAMP)
