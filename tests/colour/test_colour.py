"""Transfers and primaries against closed forms, colour-science and OpenColorIO."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest

from itmo_video.colour import primaries
from itmo_video.colour.transfer import eotf, inverse_eotf
from itmo_video.model import (
    Transfer,
)  # fmt: skip

pytestmark = pytest.mark.usefixtures("loops")
SDR = ("bt1886", "srgb", "gamma22", "linear")


def colour_science() -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it warns of every optional package that is missing
        return pytest.importorskip("colour")


# ---- transfer ----


@pytest.mark.parametrize("transfer", SDR)
def test_inverse_undoes_eotf(transfer: Transfer) -> None:
    x = np.concatenate([np.linspace(-0.2, 1.1, 1001), [0.0, 1.0]])
    assert np.abs(inverse_eotf(eotf(x, transfer), transfer) - x).max() < 3e-7
    assert eotf(np.array(1.0), transfer) == pytest.approx(1.0, abs=1e-15)
    np.testing.assert_array_equal(eotf(-x, transfer), -eotf(x, transfer))


def test_eotfs_match_colour_science() -> None:
    science = colour_science()

    x = np.linspace(0, 1, 4096)
    np.testing.assert_allclose(
        eotf(x, "bt1886"), science.models.eotf_BT1886(x, L_B=0, L_W=1), rtol=1e-12, atol=0
    )
    np.testing.assert_allclose(eotf(x, "srgb"), science.models.eotf_sRGB(x), rtol=1e-7, atol=0)
    np.testing.assert_allclose(eotf(x, "gamma22"), x**2.2, rtol=1e-12)


def test_srgb_matches_opencolorio() -> None:
    ocio = pytest.importorskip("PyOpenColorIO")
    curve = ocio.ExponentWithLinearTransform([2.4, 2.4, 2.4, 1], [0.055, 0.055, 0.055, 0])
    processor = ocio.Config.CreateRaw().getProcessor(curve).getDefaultCPUProcessor()
    x = np.linspace(0, 1, 1000, dtype=np.float32)
    rgb = np.repeat(x[:, None], 3, 1).copy()
    processor.applyRGB(rgb)
    np.testing.assert_allclose(eotf(x, "srgb"), rgb[:, 0], rtol=2e-4, atol=1e-6)


# ---- primaries ----


@pytest.mark.parametrize("source", ["rec709", "rec2020", "p3d65", "acescg", "aces2065-1"])
@pytest.mark.parametrize("target", ["rec709", "rec2020", "acescg", "aces2065-1"])
def test_matrices_match_colour_science(source: str, target: str) -> None:
    science = colour_science()

    names = {
        "rec709": "ITU-R BT.709",
        "rec2020": "ITU-R BT.2020",
        "p3d65": "P3-D65",
        "acescg": "ACEScg",
        "aces2065-1": "ACES2065-1",
    }
    spaces = []
    for name in (source, target):
        space = science.RGB_COLOURSPACES[names[name]].copy()
        space.use_derived_transformation_matrices(True)
        spaces.append(space)
    want = science.matrix_RGB_to_RGB(*spaces, chromatic_adaptation_transform="Bradford")
    np.testing.assert_allclose(primaries.rgb_to_rgb_matrix(source, target), want, atol=2e-4)


@pytest.mark.parametrize("source", primaries.CHROMATICITIES)
@pytest.mark.parametrize("target", primaries.CHROMATICITIES)
def test_white_stays_white_and_back_is_inverse(source: str, target: str) -> None:
    there = primaries.rgb_to_rgb_matrix(source, target)
    np.testing.assert_allclose(there @ np.ones(3), 1, atol=1e-12)
    back = primaries.rgb_to_rgb_matrix(target, source)
    np.testing.assert_allclose(there @ back, np.eye(3), atol=1e-12)


def test_luminance_weights() -> None:
    assert primaries.luminance_weights("rec709") == pytest.approx(
        (0.2126, 0.7152, 0.0722), abs=1e-4
    )
    assert primaries.luminance_weights("rec2020") == pytest.approx(
        (0.2627, 0.6780, 0.0593), abs=1e-4
    )
    for name in primaries.CHROMATICITIES:
        assert sum(primaries.luminance_weights(name)) == pytest.approx(1, abs=1e-12)
