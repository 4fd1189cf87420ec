"""The network of `auto`: both forms give the same shares, for pictures of any size."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from compiled_kernels import loaded, needs_kernels

from itmo_video.kernels import compiled_network, library
from itmo_video.operators import auto_network
from itmo_video.operators.auto_levels import features


def _features(height: int, width: int) -> np.ndarray:
    noise = np.random.default_rng(height).random((height, width, 3), np.float32)
    soft = cv2.GaussianBlur(noise, (0, 0), 3)
    return features(np.clip((soft - soft.min()) / np.ptp(soft) * np.float32(1.3), 0, 1), height)


@needs_kernels
@pytest.mark.parametrize(("height", "width"), [(32, 32), (32, 96), (64, 32), (160, 256)])
def test_forms_agree(height: int, width: int, monkeypatch: pytest.MonkeyPatch) -> None:
    given = _features(height, width)
    ours = auto_network.network_shares(given)
    monkeypatch.setattr(library, "library", lambda: None)
    theirs = auto_network.network_shares(given)
    assert ours.shape == theirs.shape == (compiled_network.SHOWN, height // 2, width // 2)
    assert np.ptp(theirs) > 0.3
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=3e-5)


@needs_kernels
def test_a_result_depends_on_nothing_before() -> None:
    given = _features(64, 96)
    first = auto_network.network_shares(given)
    auto_network.network_shares(_features(32, 32))
    assert np.array_equal(first, auto_network.network_shares(given))


@needs_kernels
def test_other_features_and_weights_raise() -> None:
    assert loaded is not None
    weights = auto_network._packed(loaded)
    for shape, given in (
        ((17, 24, 16), weights),
        ((16, 16, 16), weights),
        ((17, 16, 16), weights[1:]),
    ):
        with pytest.raises(ValueError, match="features"):
            compiled_network.shares(loaded, np.zeros(shape, np.float32), given)
