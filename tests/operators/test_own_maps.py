"""Operators' own maps: flat on flat frames, halting at edges, tracked; what lies outside."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from clips import moving_scene, still_encoding, write_ffv1
from luminance_operators import by_luminance

from itmo_video import RunOptions, convert
from itmo_video.expand_map.key_map import make_key_map
from itmo_video.look import make_look
from itmo_video.model import Frame
from itmo_video.operators import (
    OPERATORS,
    Context,
    LuminanceOperator,
    frame_stats,
    resolve_params,
)
from itmo_video.operators.bilateral_grid import cross_bilateral
from itmo_video.presets import make_settings
from itmo_video.rendering.frame import render


@pytest.mark.parametrize(
    "name",
    sorted(n for n, o in OPERATORS.items() if isinstance(o, LuminanceOperator) and o.make_map),
)
@pytest.mark.parametrize("level", [0.0, 0.3, 1.0])
def test_own_maps_are_flat_on_flat_frames_and_within_0_and_1(name: str, level: float) -> None:
    flat = np.full((40, 64), level, np.float32)
    operator = by_luminance(name)
    assert operator.make_map is not None
    stats = frame_stats(flat)
    params = resolve_params(operator, {})
    ctx = Context(5, 5, params, stats=stats, density=lambda y: y.copy())
    key_map = operator.make_map(flat, ctx)
    assert key_map.dtype == np.float32
    assert key_map.shape == flat.shape
    assert np.ptp(key_map) < 1e-3, f"{name} finds edges in a flat frame"
    assert 0 <= key_map.min() <= key_map.max() <= 1
    assert 0 <= operator.base_gain(ctx) <= 5


@pytest.mark.parametrize("name", ["rempel2007", "kovaleski2014"])
def test_enhancement_stops_at_edges(name: str) -> None:
    """A lamp on a bright wall enhances the wall near it, not the dark room beyond the edge."""
    picture = np.full((100, 200), 0.02, np.float32)
    picture[:, :100] = 0.75
    picture[40:60, 80:90] = 1.0
    make_map = by_luminance(name).make_map
    assert make_map is not None
    params = {"alpha": 4.0, "clip_code": 230.0, "sigma": 120.0}
    own = {"sigma_space": 150.0, "sigma_range": 25.0}
    key_map = make_map(picture, Context(5, 5, params | own))
    assert key_map[50, 85] > 0.1, "the lamp itself is not enhanced"
    assert key_map[50, 103] < 0.1 * key_map[50, 85], "enhancement leaks over the edge"
    assert key_map[50, 140] < 1e-3


def rgb_frame(red: Any, green: Any, blue: Any) -> Frame:
    encoding = still_encoding()
    return Frame(0, Fraction(0), (red, green, blue), encoding)


def test_maps_of_channels_of_a_grey_picture_are_the_map_of_its_luminance() -> None:
    codes = np.random.default_rng(3).integers(20, 90, (54, 96)).astype(np.uint8)
    codes[20:30, 40:52] = 255
    frame = rgb_frame(codes, codes, codes)
    one = make_look(make_settings("default", operator="banterle2007", l_max=8.0))
    three = make_look(make_settings("default", operator="banterle2007_channels", l_max=8.0))
    key_map, key_maps = make_key_map(frame, one), make_key_map(frame, three)
    assert key_maps.shape == (54, 96, 3)
    for i in range(3):  # each channel's linear light is the luminance but for rounding
        np.testing.assert_allclose(key_maps[..., i], key_map, atol=0.02)
    expected = render(frame, key_map, one).rgb
    for got, same in zip(render(frame, np.dstack([key_map] * 3), three).rgb, expected, strict=True):
        assert (got == same).all(), "three equal maps do not weigh as one"


def test_a_red_lamp_is_expanded_in_red() -> None:
    """The map of red is high where a red lamp is; green and blue have their own lamp elsewhere."""
    red = np.full((96, 160), 40, np.uint8)
    other = red.copy()
    red[20:40, 20:40] = 255
    other[60:80, 110:130] = 255
    frame = rgb_frame(red, other, other)
    settings = make_settings(
        "default", operator="banterle2007_channels", l_max=8.0, noise_guard=False,
        layers=("expand_map", "gain"),
    )  # fmt: skip
    look = make_look(settings)
    key_maps = make_key_map(frame, look)
    assert key_maps[30, 30, 0] > 0.8
    assert key_maps[30, 30, 1:].max() < 0.1, "green is expanded in a lamp that has none"
    rendered = render(frame, key_maps, look)
    gain = [float(plane[30, 30]) for plane in rendered.rgb]
    dark = ((40 / 255 + 0.055) / 1.055) ** 2.4
    luminance = 0.213 + (0.715 + 0.072) * dark
    curve = by_luminance("banterle2007_channels").curve
    assert curve is not None
    full = curve(np.array([luminance]), Context(8.0, 8.0))[0] / luminance
    weight = float(key_maps[30, 30, 0])
    assert gain[0] == pytest.approx(1 + weight * (full - 1), rel=0.05)
    assert gain[1] == pytest.approx(dark, rel=0.25), "green rises with red"
    seen = float(rendered.layers["expand_map.Y"][30, 30])
    assert seen == pytest.approx(key_maps[30, 30] @ [0.213, 0.715, 0.072], abs=0.03)


def test_maps_of_channels_are_tracked_and_do_not_depend_on_the_range(tmp_path: Path) -> None:
    clip = write_ffv1(tmp_path / "clip.mkv", moving_scene(7))
    settings = make_settings("default", operator="banterle2007_channels", key_interval=3)
    convert(clip, tmp_path / "all", settings, RunOptions(jobs=2))
    convert(clip, tmp_path / "one", settings, RunOptions(frames="5", jobs=1))
    name = "clip.0005.exr"
    assert (tmp_path / "all" / name).read_bytes() == (tmp_path / "one" / name).read_bytes()


def test_cross_bilateral_keeps_an_edge_and_smooths_noise() -> None:
    rng = np.random.default_rng(1)
    guide = np.zeros((40, 60), np.float32)
    guide[:, 30:] = 1
    noisy = guide + rng.normal(0, 0.05, guide.shape).astype(np.float32)
    smooth = cross_bilateral(noisy, guide, 6.0, 0.1)
    assert smooth[:, 5:25].std() < 0.02
    assert abs(float(smooth[20, 29])) < 0.05, "the edge is smeared to its dark side"
    assert abs(float(smooth[20, 30]) - 1) < 0.05, "the edge is smeared to its bright side"


def test_the_base_gain_is_what_lies_outside_an_own_map() -> None:
    codes = np.full((40, 60), 90, np.uint8)
    encoding = still_encoding()
    frame = Frame(0, Fraction(0), (codes, codes, codes), encoding)
    settings = make_settings(
        "default", operator="rempel2007", l_max=8.0, operator_params={"alpha": 2.0}
    )
    look = make_look(settings)
    rendered = render(frame, make_key_map(frame, look), look)
    light = ((90 / 255 + 0.055) / 1.055) ** 2.4
    np.testing.assert_allclose(rendered.rgb[0].astype(np.float64), 4 * light, rtol=1e-3)
