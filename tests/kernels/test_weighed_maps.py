"""Sums of maps by weights: the compiled form to the bit, for any number of channels."""

from __future__ import annotations

import numpy as np
import pytest
from compiled_kernels import loaded, needs_kernels

from itmo_video.kernels import compiled_maps, library
from itmo_video.motion import flow

SHAPES = [(9, 70), (9, 70, 1), (9, 70, 3), (9, 70, 4)]


@needs_kernels
@pytest.mark.parametrize("shape", SHAPES, ids=str)
def test_sums_to_the_bit(shape: tuple[int, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(7)
    left, right = rng.random((2, *shape), np.float32)
    weights = rng.random((2, *shape[:2]), np.float32)
    found = []
    for _ in range(2):
        total = left.copy()
        flow.add_weighed(total, right, weights[0])
        found.append((total, flow.blend_maps(left, right, 0.3, *weights)))
        monkeypatch.setattr(library, "library", lambda: None)
    for ours, theirs in zip(*found, strict=True):
        assert np.array_equal(ours, theirs)
    share = np.float32(0.3) * weights[1] / (np.float32(0.7) * weights[0] + 0.3 * weights[1])
    spread = share.reshape(*share.shape, *[1] * (len(shape) - 2))
    np.testing.assert_allclose(found[0][1], left + (right - left) * spread, rtol=1e-5)


@needs_kernels
def test_weights_of_another_size_raise() -> None:
    assert loaded is not None
    maps = np.zeros((9, 70, 3), np.float32)
    for weight in (np.zeros((9, 71), np.float32), np.zeros((70, 9), np.float32)):
        with pytest.raises(ValueError, match="weight"):
            compiled_maps.add_weighed(loaded, maps, maps, weight)
    with pytest.raises(ValueError, match="shapes"):
        compiled_maps.blend(loaded, maps, maps[:5], np.zeros((9, 70), np.float32))
