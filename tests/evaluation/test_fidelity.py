"""Fidelity figures against hand-computed values and published tables."""

from __future__ import annotations

import math

import numpy as np
import pytest

from itmo_video.colour.transfer import pq_code
from itmo_video.evaluation import fidelity

RNG = np.random.default_rng(3)
PICTURE = np.exp(RNG.uniform(-3, 6, (24, 32)))


def test_pq_against_st_2084() -> None:
    """BT.2408 table 1: 203 cd/m2 is 58 % PQ; ST 2084: 100 is 0.5081, 10000 is 1."""
    nits = np.array([0.0, 100.0, 203.0, 1000.0, 10000.0])
    expected = [0.0, 0.508078, 0.580689, 0.751827, 1.0]
    np.testing.assert_allclose(pq_code(nits), expected, atol=1e-6)


def test_pu21_against_its_published_values() -> None:
    """The authors' pu21_encoder, banding_glare: 0 at least, 256 at 100 cd/m2, 595.3939 at most."""
    codes = fidelity.pu21_encode(np.array([0.005, 100.0, 10000.0]))
    assert codes[0] == pytest.approx(0, abs=1e-6)
    assert codes[1] == pytest.approx(256, abs=0.5)
    assert codes[2] == pytest.approx(595.3939, abs=1e-4)
    assert fidelity.pu21_encode(np.array([0.0]))[0] == codes[0], "darker than its domain"
    assert (np.diff(fidelity.pu21_encode(np.geomspace(0.005, 10000, 500))) > 0).all()


def test_psnr_by_hand() -> None:
    """Differences of 3 and 1 of 4 pixels: MSE 2.5; peak 10: 10 log10(100 / 2.5) = 16.0206 dB."""
    a, b = np.zeros((2, 2)), np.array([[3.0, 1.0], [0.0, 0.0]])
    assert fidelity.psnr_db(a, b, 10) == pytest.approx(16.0206, abs=1e-4)


def test_pq_psnr_by_hand() -> None:
    """Everywhere 100 against 1000 cd/m2: -20 log10(0.751827 - 0.508078) = 12.2613 dB."""
    one = np.full((4, 5), 100.0)
    assert fidelity.pq_psnr_db(one, 10 * one) == pytest.approx(12.2613, abs=1e-3)


def test_pu21_psnr_of_a_known_step() -> None:
    one = np.full((4, 5), 100.0)
    step = abs(float(np.diff(fidelity.pu21_encode(np.array([100.0, 1000.0])))[0]))
    assert fidelity.pu21_psnr_db(one, 10 * one) == pytest.approx(20 * math.log10(256 / step))


def test_identical_pictures() -> None:
    figures = fidelity.compare(PICTURE, PICTURE.copy())
    assert figures.pq_psnr_db == math.inf, "identical inputs must have infinite PSNR"
    assert figures.pu21_psnr_db == math.inf
    assert figures.pu21_ssim == pytest.approx(1.0)
    assert figures.visible_share == figures.obvious_share == 0
    assert set(figures.percentiles.values()) == {0.0}
    assert all(z.mean == 0 for z in figures.zones if z.share)


def test_ssim_of_flat_pictures_by_hand() -> None:
    """Without structure SSIM is (2 x y + c1) / (x^2 + y^2 + c1)."""
    x, y = fidelity.pu21_encode(np.array([10.0, 200.0]))
    c1 = 2.56**2
    expected = (2 * x * y + c1) / (x * x + y * y + c1)
    got = fidelity.pu21_ssim(np.full((16, 16), 10.0), np.full((16, 16), 200.0))
    assert got == pytest.approx(expected, rel=1e-9)


def test_ssim_falls_with_noise_and_stays_in_its_range() -> None:
    values = [fidelity.pu21_ssim(PICTURE * RNG.lognormal(0, s, PICTURE.shape), PICTURE)
              for s in (0.01, 0.2, 2.0)]  # fmt: skip
    assert 1 > values[0] > values[1] > values[2] > -1


def test_zones_by_hand() -> None:
    """White 100: 50 is in [-2, 0) and comes out doubled, 300 in [1, 2) and comes out halved."""
    truth, test = np.array([[50.0, 50.0], [300.0, 50.0]]), np.array([[100.0, 50.0], [150.0, 50.0]])
    found = {z.lower: z for z in fidelity.zones(test, truth, 100.0)}
    assert found[-2.0].share == 0.75
    assert found[-2.0].mean == pytest.approx(1 / 3)
    assert found[1.0].mean == pytest.approx(-1)
    assert found[1.0].mean_abs == pytest.approx(1)
    assert math.isnan(found[2.0].mean), "an empty zone has no error"
    assert sum(z.share for z in found.values()) == 1


def test_percentiles_by_hand() -> None:
    truth = np.arange(1.0, 102.0).reshape(1, -1)
    found = fidelity.percentile_stops(truth * 4, truth, (50.0, 100.0))
    assert found == {50.0: pytest.approx(2), 100.0: pytest.approx(2)}


def test_visible_share_by_hand() -> None:
    """One pixel of four a fifth brighter: about 0.02 of PQ code at 100 cd/m2."""
    truth = np.full((2, 2), 100.0)
    test = truth.copy()
    test[0, 0] = 120
    test[1, 1] = 101
    assert fidelity.visible_share(test, truth) == 0.25
    assert fidelity.visible_share(test, truth, fidelity.OBVIOUS) == 0


def test_the_display_clips_both_ends() -> None:
    rgb = np.array([[[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [100.0, 100.0, 100.0]]])
    np.testing.assert_allclose(fidelity.displayed(rgb), [[0.005, 203.0, 1000.0]])
    with pytest.raises(ValueError, match="not numbers"):
        fidelity.displayed(np.full((1, 1, 3), np.nan))


def test_different_sizes_are_refused() -> None:
    with pytest.raises(ValueError, match="differ in size"):
        fidelity.compare(PICTURE, PICTURE[:-1])
