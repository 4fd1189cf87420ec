"""The field's operators against their forward forms, published constants and hand-made pictures."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from clips import still_encoding
from luminance_operators import by_luminance

from itmo_video.expand_map.key_map import make_key_map
from itmo_video.look import make_look
from itmo_video.model import Frame
from itmo_video.operators import (
    OPERATORS,
    Context,
    FrameStats,
    bt2446,
    drago2003,
    filmic,
    frame_stats,
    masia2017,
    resolve_params,
    ward1994,
)
from itmo_video.presets import make_settings
from itmo_video.rendering.frame import render

DISPLAY = np.linspace(1e-4, 1, 1001)
STATS = FrameStats(0.0, 1.0, 0.1, 0.5, 0.01, 0.8)


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
    assert (stats.minimum, stats.maximum) == pytest.approx((0.01, 1))
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


@pytest.mark.parametrize("name", sorted(OPERATORS))
def test_every_operator_renders_and_keeps_its_range(name: str) -> None:
    """base + map * (gain - base): a frame with a lamp, through key map and rendering."""
    codes = np.full((54, 96), 60, np.uint8)
    codes[20:30, 40:52] = 255
    encoding = still_encoding()
    frame = Frame(0, Fraction(0), (codes, codes, codes), encoding)
    look = make_look(make_settings("default", operator=name, l_max=8.0))
    key_map = make_key_map(frame, look) if look.needs_map else None
    rendered = render(frame, key_map, look)
    out = rendered.rgb[0].astype(np.float64)
    assert np.isfinite(out).all(), f"{name} renders what is not a number"
    assert out.min() >= 0
    assert out.max() <= 8.0 * 1.001, f"{name} passes the maximum"
    assert out[25, 46] > out[5, 5], f"{name} makes a lamp darker than its wall"
