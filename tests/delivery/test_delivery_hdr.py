"""PQ, HLG, Y'CbCr and the light levels against published values and colour-science."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from oracles import hlg_nits

from itmo_video.colour import transfer
from itmo_video.delivery import hdr
from itmo_video.delivery.choices import Chroma
from itmo_video.delivery.ycbcr import Planes, to_ycbcr
from itmo_video.kernels import library

with warnings.catch_warnings():  # it tells of every optional library that it misses
    warnings.simplefilter("ignore")
    import colour as colour_science


def _planes(nits: float, shape: tuple[int, int] = (8, 16)) -> Planes:
    plane = np.full(shape, nits, np.float32)
    return plane, plane.copy(), plane.copy()


def test_pq_agrees_with_st2084() -> None:
    nits = np.geomspace(0.001, 10000, 200)
    expected = np.asarray(colour_science.models.eotf_inverse_ST2084(nits), np.float64)
    np.testing.assert_allclose(
        transfer.pq_code(nits), expected, atol=1e-9, err_msg="PQ's curve is off"
    )
    np.testing.assert_allclose(
        transfer.pq_nits(expected), nits, rtol=1e-6, err_msg="PQ's EOTF is off"
    )


def test_fast_pq_stays_within_a_tenth_of_a_code() -> None:
    nits = np.geomspace(0.01, 10000, 4096).astype(np.float32).reshape(64, 64)
    fast = hdr.encode_nits((nits, nits, nits), "pq", 10000)[0]
    worst = np.abs(fast - transfer.pq_code(nits)).max() * 876
    assert worst < 0.1, f"the half-float table errs by {worst:.3f} of a 10-bit code"


def test_hlg_agrees_with_bt2100() -> None:
    scene = np.linspace(0.001, 1, 101)
    with np.errstate(all="ignore"):
        expected = colour_science.models.oetf_BT2100_HLG(scene)
    np.testing.assert_allclose(transfer.hlg_oetf(scene), expected, atol=1e-6, err_msg="HLG's OETF")
    assert transfer.hlg_gamma(1000) == pytest.approx(1.2), "system gamma at 1000 nits"
    assert transfer.hlg_gamma(2000) == pytest.approx(1.2 + 0.42 * np.log10(2), rel=5e-3)


@pytest.mark.parametrize("peak", [600.0, 1000.0, 4000.0])
def test_hlg_signal_shows_the_same_nits_again(peak: float) -> None:
    rng = np.random.default_rng(1)
    # Mildly saturated: BT.2100's OOTF cannot make pure blue at the peak of white.
    level = rng.uniform(0.05, 0.7 * peak, (32, 32))
    nits = (level * rng.uniform(0.6, 1, (3, 32, 32))).astype(np.float32)
    code = hdr.encode_nits((nits[0], nits[1], nits[2]), "hlg", peak)
    back = hlg_nits(np.stack(code).astype(np.float64), peak)
    np.testing.assert_allclose(back, nits, rtol=5e-3, err_msg="inverse OOTF is not the inverse")


def test_white_and_peak_keep_their_nits() -> None:
    one = np.ones((4, 4), np.float16)
    nits = hdr.to_nits_2020((one, one, one), "rec709", 203, 1000)
    assert np.allclose(nits, 203, rtol=1e-4), "SDR white is not at white_nits"
    ten = one * np.float16(10)
    assert np.allclose(hdr.to_nits_2020((ten, ten, ten), "rec709", 203, 1000), 1000), "not limited"


def test_limited_range_codes_of_grey() -> None:
    code = np.full((64, 64), 0.5, np.float32)
    luma, cb, cr = to_ycbcr((code, code, code), "bt2020", "420", 3)
    assert luma.mean() == pytest.approx(64 + 876 * 0.5, abs=0.02), "dither moves the mean"
    assert cb.shape == cr.shape == (32, 32)
    assert abs(cb.mean() - 512) < 0.1, "grey is coloured"
    assert abs(cr.mean() - 512) < 0.1, "grey is coloured"


def test_dither_depends_on_the_index_alone_and_moves() -> None:
    code = np.full((40, 40), 0.30031, np.float32)
    first, again, other = (to_ycbcr((code, code, code), "bt2020", "422", i)[0] for i in (5, 5, 6))
    assert (first == again).all(), "dither is not deterministic"
    assert (first != other).any(), "dither stands still"


def test_light_levels_are_of_max_rgb() -> None:
    red = np.zeros((2, 2), np.float32)
    red[0, 0] = 800
    light = hdr.frame_light((red, red / np.float32(2), red / np.float32(4)))
    assert light == hdr.Light(800.0, 200.0), "CTA-861.3 counts max(R, G, B)"
    assert hdr.film_light([light, hdr.Light(100.0, 300.0)]) == hdr.Light(800.0, 300.0)
    assert hdr.Light(0, 0).as_integers == (1, 1), "0 would mean unknown"


@pytest.mark.parametrize("shape", [(70, 50), (41, 33), (32, 64)])
@pytest.mark.parametrize("chroma", ["420", "422"])
def test_strips_make_the_whole_frame(
    shape: tuple[int, int], chroma: Chroma, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The plain form has strips; test_to_codes.py holds both against float64.
    monkeypatch.setattr(library, "library", lambda: None)
    rng = np.random.default_rng(2)
    rgb = [rng.uniform(0, 5, shape).astype(np.float16) for _ in range(3)]
    planes, light = hdr.master_frame(rgb, "rec709", 203, 1000, "pq", chroma, 4)
    nits = hdr.to_nits_2020(rgb, "rec709", 203, 1000)
    whole = to_ycbcr(hdr.pad_even(hdr.encode_nits(nits, "pq", 1000)), "bt2020", chroma, 4)
    for strip, frame in zip(planes, whole, strict=True):
        assert strip.shape == frame.shape
        # A strip's last bits may differ (vector loop or scalar tail), so a rounding may.
        assert np.abs(strip.astype(int) - frame).max() <= 1
        assert np.mean(strip != frame) < 0.001, "strips are not the frame"
    assert light.peak == pytest.approx(hdr.frame_light(nits).peak, rel=1e-5)
    assert light.average == pytest.approx(hdr.frame_light(nits).average, rel=1e-5)
