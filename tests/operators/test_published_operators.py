"""The field's operators against their forward forms, published constants and hand-made pictures."""

from __future__ import annotations

import math
from fractions import Fraction
from importlib import metadata
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from clips import moving_scene, write_ffv1

from itmo_video import RunOptions, convert
from itmo_video.errors import OutputError, UsageError
from itmo_video.expand_map.key_map import make_key_map
from itmo_video.look import make_look
from itmo_video.model import Encoding, Frame
from itmo_video.operators import (
    OPERATORS,
    Context,
    FrameStats,
    LuminanceOperator,
    all_operators,
    bt2446,
    drago2003,
    filmic,
    find_operator,
    frame_stats,
    gain_of,
    masia2017,
    resolve_params,
    version_of,
    ward1994,
)
from itmo_video.operators.bilateral_grid import cross_bilateral
from itmo_video.presets import make_settings
from itmo_video.rendering.frame import render
from itmo_video.settings import Settings

DISPLAY = np.linspace(1e-4, 1, 1001)
STATS = FrameStats(0.0, 1.0, 0.1, 0.5, 0.01, 0.8)


def by_luminance(name: str) -> LuminanceOperator:
    operator = OPERATORS[name]
    assert isinstance(operator, LuminanceOperator)
    return operator


def make(name: str, l_max: float, stats: FrameStats = STATS, **given: float) -> Context:
    return Context(l_max, l_max, resolve_params(OPERATORS[name], given), stats=stats)


def expand(name: str, l_max: float = 20, stats: FrameStats = STATS, **given: float) -> Any:
    curve = by_luminance(name).curve
    assert curve is not None
    return curve(DISPLAY, make(name, l_max, stats, **given))


def returns(name: str, back: Any) -> None:
    np.testing.assert_allclose(
        back, DISPLAY, rtol=1e-6, err_msg=f"the forward operator does not undo {name}"
    )


@pytest.mark.parametrize("l_max", [1.5, 4.93, 200.0])
def test_forward_operators_undo_their_inverses(l_max: float) -> None:
    world = expand("schlick1994", l_max, p=30)
    returns("schlick1994", 30 * world / (29 * world + l_max))
    world = expand("drago2003", l_max)
    returns("drago2003", drago2003.forward(world, l_max, 0.85))
    world = expand("drago2003", l_max, adaptation=0.18, bias=0.7)
    returns("drago2003", drago2003.forward(world / 0.18, l_max / 0.18, 0.7))
    world = expand("filmic", l_max)
    returns("filmic", filmic.forward(world * 11.2 / l_max, 11.2))
    world = expand("reinhard2002", l_max)
    returns("reinhard2002", world * (1 + 1 / l_max) / (1 + world))
    world = expand("banterle2006", l_max)
    returns("banterle2006", world * (1 + world / l_max**2) / (1 + world))
    world = expand("landis2002", l_max)
    above = DISPLAY > 0.5
    from_log = 0.5 + 0.5 * np.log(world / DISPLAY) / math.log(l_max)
    returns("landis2002", np.where(above, from_log, world))
    world = expand("meylan2006", l_max)
    knee = 0.67 * l_max
    returns(
        "meylan2006",
        np.where(world <= knee, world * 0.8 / knee, 0.8 + (world - knee) / (0.33 * l_max) * 0.2),
    )
    world = expand("akyuz2007", l_max, gamma=2.0)
    returns("akyuz2007", np.sqrt(world / l_max))
    gamma = masia2017.exponent(make("masia2017", l_max))
    returns("masia2017", (expand("masia2017", l_max) / l_max) ** (1 / gamma))


def test_ward_undoes_the_published_scale_factor() -> None:
    """L_wa 1000 on a display of 100: m = ((1.219 + 50^0.4) / (1.219 + 1000^0.4))^2.5 / 100."""
    m = ((1.219 + 4.781762) / (1.219 + 15.848932)) ** 2.5 / 100
    assert ward1994.scale_factor(1000, 100) == pytest.approx(m, rel=1e-6)
    returns("ward1994", m * 100 * expand("ward1994", 50))
    limited = expand("ward1994", 3.0)
    assert limited[-1] == pytest.approx(3.0), "the maximum is passed"


def forward_bt2446c(hdr_nits: Any) -> Any:
    """Section 6.1.4: SDR luminance of HDR luminance, both in cd/m2 (SDR white 100)."""
    above = np.maximum(hdr_nits, bt2446.KNEE_HDR)
    return np.where(
        hdr_nits < bt2446.KNEE_HDR,
        bt2446.K1 * hdr_nits,
        bt2446.K2 * np.log(above / bt2446.KNEE_HDR - bt2446.K3) + bt2446.K4,
    )


def test_bt2446c_agrees_with_the_report() -> None:
    assert pytest.approx((15.09968, 78.99439), abs=1e-4) == (bt2446.K2, bt2446.K4)
    assert pytest.approx(58.5, abs=0.05) == bt2446.KNEE
    world = expand("bt2446c", 1000) * 203
    returns("bt2446c", forward_bt2446c(world) / 100)
    # The conditions that the report derives its constants from (section 6.1.4).
    assert float(forward_bt2446c(np.array(203.0))) == pytest.approx(100 * 0.96**2.4, rel=1e-3), (
        "HDR reference white is not at 96 % SDR"
    )
    assert world[-1] == pytest.approx(332.4, abs=0.5)


def test_bt2446a_agrees_with_table_4_and_nearly_undoes_method_a() -> None:
    curve = by_luminance("bt2446a").curve
    assert curve is not None
    code = np.array([70.0, 255.0, 128.0])
    world = curve((code / 255) ** 2.4, make("bt2446a", 1000.0))
    # 70^1.214451, 255^1.246565 and 128^1.203659, by hand from table 4, over 1000, to 2.4.
    hdr = np.array([174.09, 999.84, 343.84])
    np.testing.assert_allclose(world, 1000 * (hdr / 999.84) ** 2.4, rtol=3e-4)
    # Table 2, forward: the report's table 4 is a fit to its inverse.
    y = (curve(DISPLAY, make("bt2446a", 10.0)) / 10) ** (1 / 2.4)
    p_hdr, p_sdr = 1 + 32 * 0.1 ** (1 / 2.4), 1 + 32 * 0.01 ** (1 / 2.4)
    yp = np.log(1 + (p_hdr - 1) * y) / math.log(p_hdr)
    yc = np.where(
        yp <= 0.7399,
        1.0770 * yp,
        np.where(yp < 0.9909, (-1.1510 * yp + 2.7811) * yp - 0.6302, 0.5 * yp + 0.5),
    )
    sdr = (p_sdr**yc - 1) / (p_sdr - 1)
    error = np.abs(sdr - DISPLAY ** (1 / 2.4))
    assert error.max() < 0.02, f"method A does not come back: off by {error.max():.3f} of the code"


def test_masia_exponent_by_hand() -> None:
    """2.4379 + 0.2319 ln 0.1 - 1.1228 * 0.5 + 0.0085 * 1 %, and kept from falling below."""
    assert masia2017.exponent(make("masia2017", 5)) == pytest.approx(1.351033, abs=1e-5)
    dark = FrameStats(0, 1, 1e-5, 0.9, 0, 0.8)
    assert masia2017.exponent(make("masia2017", 5, dark, gamma_min=1)) == 1


def test_frame_statistics_by_hand() -> None:
    half = np.full((100, 100), 0.01, np.float32)
    half[:, 50:] = 1
    stats = frame_stats(half)
    assert (stats.minimum, stats.maximum) == (pytest.approx(0.01), 1)
    assert stats.geometric_mean == pytest.approx(0.1, rel=1e-4)
    assert stats.key == pytest.approx(0.5, abs=1e-4)
    assert stats.over_share == 0.5
    assert stats.diffuse_white == pytest.approx(1)
    black = frame_stats(np.zeros((4, 4), np.float32))
    assert np.isfinite([black.key, black.geometric_mean]).all()


@pytest.mark.parametrize("name", sorted(n for n, o in OPERATORS.items() if o.needs_stats))
@pytest.mark.parametrize("level", [0.0, 0.3, 1.0])
def test_flat_frames_stay_finite(name: str, level: float) -> None:
    flat = np.full((20, 30), level, np.float32)
    gain = by_luminance(name).gain(flat, make(name, 5, frame_stats(flat)))
    assert np.isfinite(gain).all(), f"{name} divides by the range of a flat frame"


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
    encoding = Encoding("rgb", 8, "bt709", "full", "srgb", "rec709")
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


class _Point:
    name, value = "doubled", "somewhere:operator"

    def __init__(self, thing: object, version: str | None = None) -> None:
        self.thing = thing
        self.dist = None if version is None else SimpleNamespace(name="mine", version=version)

    def load(self) -> object:
        if isinstance(self.thing, Exception):
            raise self.thing
        return self.thing


def _install(monkeypatch: pytest.MonkeyPatch, thing: object, version: str | None = None) -> None:
    points = [_Point(thing, version)]
    monkeypatch.setattr(
        metadata,
        "entry_points",
        lambda group, name=None: [p for p in points if name in (None, p.name)],
    )


def test_users_operators_are_found_by_entry_point(monkeypatch: pytest.MonkeyPatch) -> None:
    mine = LuminanceOperator("doubled", "twice", "mine", gain_of(lambda y, _: 2 * y))
    _install(monkeypatch, mine)
    assert find_operator(Settings(operator="doubled")) is mine
    assert set(all_operators()) == set(OPERATORS) | {"doubled"}
    assert (mine.gain(np.ones((2, 2), np.float32), Context(5, 5)) == 2).all()


def test_a_users_operators_version_is_part_of_the_fingerprint(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    clip, out = tmp_path / "clip.mkv", tmp_path / "out"
    write_ffv1(clip, moving_scene(2))
    mine = LuminanceOperator("doubled", "twice", "mine", gain_of(lambda y, _: 2 * y))
    _install(monkeypatch, mine, "1.0")
    settings = make_settings("default", operator="doubled")
    assert convert(clip, out, settings).written == 2
    assert convert(clip, out, settings).present == 2, "the same version is not found again"
    _install(monkeypatch, mine, "1.1")
    with pytest.raises(OutputError, match="other settings"):
        convert(clip, out, settings)
    assert convert(clip, out, settings, RunOptions(update=True)).written == 2
    assert version_of("doubled") == "mine 1.1"
    assert version_of("linear") == "", "a built-in operator's fingerprint would move"


@pytest.mark.parametrize("thing", [ImportError("no such module"), "not an operator"])
def test_a_broken_entry_point_is_told(monkeypatch: pytest.MonkeyPatch, thing: object) -> None:
    _install(monkeypatch, thing)
    with pytest.raises(UsageError, match="doubled"):
        find_operator(Settings(operator="doubled"))
    assert find_operator(Settings(operator="linear")).name == "linear"


@pytest.mark.parametrize("name", sorted(OPERATORS))
def test_every_operator_renders_and_keeps_its_range(name: str) -> None:
    """base + map * (gain - base): a frame with a lamp, through key map and rendering."""
    codes = np.full((54, 96), 60, np.uint8)
    codes[20:30, 40:52] = 255
    encoding = Encoding("rgb", 8, "bt709", "full", "srgb", "rec709")
    frame = Frame(0, Fraction(0), (codes, codes, codes), encoding)
    look = make_look(make_settings("default", operator=name, l_max=8.0))
    key_map = make_key_map(frame, look) if look.needs_map else None
    rendered = render(frame, key_map, look)
    out = rendered.rgb[0].astype(np.float64)
    assert np.isfinite(out).all(), f"{name} renders what is not a number"
    assert out.min() >= 0
    assert out.max() <= 8.0 * 1.001, f"{name} passes the maximum"
    assert out[25, 46] > out[5, 5], f"{name} makes a lamp darker than its wall"


def test_the_base_gain_is_what_lies_outside_an_own_map() -> None:
    codes = np.full((40, 60), 90, np.uint8)
    encoding = Encoding("rgb", 8, "bt709", "full", "srgb", "rec709")
    frame = Frame(0, Fraction(0), (codes, codes, codes), encoding)
    settings = make_settings(
        "default", operator="rempel2007", l_max=8.0, operator_params={"alpha": 2.0}
    )
    look = make_look(settings)
    rendered = render(frame, make_key_map(frame, look), look)
    light = ((90 / 255 + 0.055) / 1.055) ** 2.4
    np.testing.assert_allclose(rendered.rgb[0].astype(np.float64), 4 * light, rtol=1e-3)
