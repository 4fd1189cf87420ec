"""Where nothing clips `auto` does not ask its network, and maps of 0 are carried without motion."""

from __future__ import annotations

import numpy as np
import pytest

from itmo_video.motion import flow
from itmo_video.operators import auto
from itmo_video.operators.base import Context

DISPLAY = Context(1000 / 203, 1000 / 203)


def _asked(*given: object) -> np.ndarray:
    raise AssertionError("the network was asked")


def test_the_network_is_asked_only_if_something_clips(monkeypatch: pytest.MonkeyPatch) -> None:
    picture = np.random.default_rng(2).random((48, 64, 3), np.float32) * np.float32(0.7)
    before = auto.map_auto(picture, DISPLAY)
    monkeypatch.setattr(auto, "level_shares", _asked)
    assert np.array_equal(auto.map_auto(picture, DISPLAY), before)
    assert before[..., :3].max() == 0
    picture[10:30, 10:40] = 1
    with pytest.raises(AssertionError, match="asked"):
        auto.map_auto(picture, DISPLAY)


def test_what_is_opened_is_0_where_nothing_is_known() -> None:
    """So leaving the network out changes nothing."""
    picture = np.random.default_rng(2).random((48, 64, 3), np.float32) * np.float32(0.7)
    opened, _ = auto._opened(picture, picture, np.zeros_like(picture), DISPLAY, False)
    assert not opened.any()


def test_maps_of_zero_need_no_motion() -> None:
    grey = np.random.default_rng(2).integers(0, 255, (40, 60), np.uint8)
    none, some = np.zeros((2, 40, 60, 4), np.float32)
    some[3, 4, 1] = 1

    def find_flow(here: np.ndarray, there: np.ndarray) -> np.ndarray:
        raise LookupError("motion")

    assert not flow.track_map(grey, (grey, none), (grey, none), 0.4, find_flow).any()
    with pytest.raises(LookupError, match="motion"):
        flow.track_map(grey, (grey, none), (grey, some), 0.4, find_flow)
