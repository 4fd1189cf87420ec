"""A keyframe's planes near white: both forms of each kernel agree."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import pytest

from itmo_video.colour.luminance import greatest_of, luminance_of_pixels
from itmo_video.kernels import compiled_near_white, library
from itmo_video.model import Float32
from itmo_video.operators import auto_clipping, auto_levels, auto_parting, auto_rendering

loaded = library.library()
compiled = pytest.mark.skipif(loaded is None, reason="installed without a C compiler")
SHAPES = [(36, 50), (7, 1), (1, 3)]


def _pictures(shape: tuple[int, int]) -> list[np.ndarray]:
    """Pictures (H, W, 3) of which much is at 0 and at 1."""
    light = np.random.default_rng(9).random((3, *shape, 3), np.float32)
    return list(np.clip(light * np.float32(1.4) - np.float32(0.2), 0, 1))


FORMS: dict[str, Callable[[Any, Any, Any], Any]] = {
    "greatest": lambda a, b, c: greatest_of(a),
    "luminance": lambda a, b, c: luminance_of_pixels(a),
    "known": lambda a, b, c: auto_clipping.known_clipped(a),
    "colour": lambda a, b, c: auto_parting.colour_of_bright(a),
    "lost": lambda a, b, c: auto_parting.colour_lost(a, b),
    "parting": lambda a, b, c: auto_parting.bounded_parting(a, b, c * np.float32(0.2), 2.3),
    "together": lambda a, b, c: auto_parting.decided_together(b, a, c * np.float32(0.2)),
    "held": lambda a, b, c: auto_parting.held_together(a, b * np.float32(0.2), greatest_of(c)),
    "codes": lambda a, b, c: auto_levels.srgb_codes(a),
    "features": lambda a, b, c: auto_levels.features(np.tile(a, (2, 2, 1)), 2 * a.shape[0]),
}


@compiled
@pytest.mark.parametrize("shape", SHAPES, ids=str)
@pytest.mark.parametrize("name", FORMS)
def test_forms_agree(name: str, shape: tuple[int, int], monkeypatch: pytest.MonkeyPatch) -> None:
    given = _pictures(shape)
    ours = FORMS[name](*given)
    monkeypatch.setattr(library, "library", lambda: None)
    theirs = FORMS[name](*given)
    assert ours.shape == theirs.shape
    assert ours.dtype == theirs.dtype == np.float32
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=2e-5)


@compiled
def test_pictures_of_other_sizes_raise() -> None:
    assert loaded is not None
    one, other = np.zeros((4, 5, 3), np.float32), np.zeros((5, 4, 3), np.float32)
    with pytest.raises(ValueError, match="shape"):
        compiled_near_white.held_together(loaded, one, one, other[..., 0])
    with pytest.raises(ValueError, match="shape"):
        compiled_near_white.bounded_parting(loaded, one, one, other, 1.0, (0.5, 1.0), 1e-3)
    with pytest.raises(ValueError, match="shape"):
        compiled_near_white.greatest(loaded, one[..., :2])


@pytest.mark.parametrize("rows", [(0, 0), (0, 2), (11, 12), (30, 40), (0, 40)], ids=str)
@pytest.mark.parametrize("sigma", [1, 1.75, 2.5])
@pytest.mark.parametrize("shape", [(40, 32, 3), (40, 32), (40, 31, 3), (3, 2, 3), (1, 1)], ids=str)
def test_a_blur_is_opencvs(shape: tuple[int, ...], sigma: float, rows: tuple[int, int]) -> None:
    planes = np.zeros(shape, np.float32)
    planes[slice(*rows)] = np.random.default_rng(6).random(shape, np.float32)[slice(*rows)]
    taps = 2 * round(3 * sigma) + 1
    whole = cv2.GaussianBlur(planes, (taps, taps), sigma, borderType=cv2.BORDER_REFLECT)
    ours = auto_clipping.blurred(planes, sigma)
    np.testing.assert_allclose(ours, whole.reshape(shape), rtol=0, atol=5e-7)
    assert ours.shape == shape
    assert not ours.any() or planes.any()


@pytest.mark.parametrize("shares", [(0.0, 1.0), (0.1, 0.5, 0.999)], ids=str)
def test_quantiles_are_numpys(shares: tuple[float, ...]) -> None:
    rng = np.random.default_rng(4)
    cases: list[Float32] = [
        rng.random((40, 50), np.float32),
        np.asarray(np.rint(rng.random((9, 31), np.float32) * 20) / np.float32(20), np.float32),
        np.full((3, 3), -0.0, np.float32),
        np.array([[0.25]], np.float32),
    ]
    for values in cases:
        found = auto_rendering._quantiles(values, shares)
        np.testing.assert_allclose(found, np.quantile(values, shares), rtol=1e-7)
