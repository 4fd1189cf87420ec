"""Image-based lighting: figures by hand, and a render where Mitsuba is installed."""

from __future__ import annotations

import builtins
from importlib.util import find_spec
from typing import Any

import numpy as np
import pytest

from itmo_video.errors import UsageError
from itmo_video.evaluation import ibl

SHAPE = (ibl.HEIGHT, ibl.WIDTH, 3)


def test_error_by_hand() -> None:
    """Twice the light everywhere: the error is the mean itself."""
    truth = np.full(SHAPE, 0.5)
    found = ibl.compare_lit(2 * truth, truth)
    assert found.error == pytest.approx(1.0)
    assert found.exposed_error == pytest.approx(0.0, abs=1e-9), "an exposure makes up for it"
    assert found.depth == (0.0, 0.0), "there is no shadow on an even ground"
    assert ibl.compare_lit(truth, truth).error == 0


def test_shadows_by_hand() -> None:
    """A shadow four stops deep between the balls, and the same of one stop."""
    hard, soft = np.ones(SHAPE), np.ones(SHAPE)
    hard[:, 98:104], soft[:, 98:104] = 1 / 16, 1 / 2
    found = ibl.compare_lit(soft, hard)
    assert found.depth == pytest.approx((1, 4))
    assert found.sharpness == pytest.approx((0.5, 2)), "central differences"


def test_the_ground_is_neither_ball_nor_sky() -> None:
    mask = ibl.ground_mask()
    assert mask.shape == SHAPE[:2]
    assert not mask[:30].any(), "the sky is taken for ground"
    assert mask[-10:].all(), "the ground before the balls is missing"
    assert not mask[64, 65], "the diffuse ball is taken for ground"
    assert not mask[64, 135]


def test_different_sizes_are_refused() -> None:
    with pytest.raises(ValueError, match="differ in size"):
        ibl.compare_lit(np.ones((4, 4, 3)), np.ones((4, 5, 3)))


def test_without_mitsuba_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def without(name: str, *args: Any, **kwargs: Any) -> Any:
        if name == "mitsuba":
            raise ImportError(name)
        return real(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(UsageError, match="needs Mitsuba"):
        ibl.render_lit(np.ones((4, 8, 3), np.float32))


@pytest.mark.skipif(find_spec("mitsuba") is None, reason="extra ibl is not installed")
def test_light_adds_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ibl, "SAMPLES", 4)
    sky = np.ones((8, 16, 3), np.float32)
    np.testing.assert_allclose(ibl.render_lit(3 * sky), 3 * ibl.render_lit(sky), rtol=1e-3)
