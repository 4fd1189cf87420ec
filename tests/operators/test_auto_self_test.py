"""The operator `auto` asks its network of light that is still there, and holds back if it fails."""

from __future__ import annotations

import numpy as np
import pytest

from itmo_video.operators import auto_levels, auto_self_test
from itmo_video.operators.auto_self_test import LEAST_PASSED, LITTLE_STOPS, MUCH_STOPS, self_test


def picture(between: float, white: float = 0.25) -> np.ndarray:
    """Rows at 0.1 of white, shares of them at 0.7 and at white: (64, 96, 3)."""
    rows = np.full((64, 96, 3), 0.1, np.float32)
    rows[: round(64 * white)] = 1
    rows[64 - round(64 * between) :] = 0.7
    return rows


def asked(monkeypatch: pytest.MonkeyPatch, at_white: float, elsewhere: float) -> list[np.ndarray]:
    """Let the network say that shares of what is in the upper half, and elsewhere, are bright."""
    given: list[np.ndarray] = []

    def level_shares(rgb_linear: np.ndarray, wrap_x: bool) -> np.ndarray:
        given.append(rgb_linear)
        shares = np.full((3, len(auto_levels.EDGES_STOPS) - 1, 32, 48), elsewhere, np.float32)
        shares[:, :, :16] = at_white
        return shares

    monkeypatch.setattr(auto_self_test, "level_shares", level_shares)
    return given


def test_who_tells_white_from_less_is_trusted(monkeypatch: pytest.MonkeyPatch) -> None:
    given = asked(monkeypatch, 0.8, 0.4)  # 0.53 stops apart of 1.32
    assert self_test(picture(0.25), 0.1) == 1
    assert given[0].max() == 1
    assert (given[0][-1] == 1).all(), "0.7 is clipped for the test"


def test_who_does_not_is_held_back_where_he_says_little(monkeypatch: pytest.MonkeyPatch) -> None:
    asked(monkeypatch, 0.5, 0.5)
    assert self_test(picture(0.25), 0.1) == pytest.approx(LEAST_PASSED)
    kept = [self_test(picture(0.25), stops) for stops in (LITTLE_STOPS, 0.37, MUCH_STOPS)]
    assert kept[0] == pytest.approx(LEAST_PASSED)
    assert LEAST_PASSED < kept[1] < kept[2] == 1


@pytest.mark.parametrize(
    ("between", "white"), [(0, 0.25), (0.9, 0.1), (0.25, 0)], ids=["few", "most", "nothing white"]
)
def test_it_does_not_count_where_there_is_nothing_to_test_by(
    monkeypatch: pytest.MonkeyPatch, between: float, white: float
) -> None:
    given = asked(monkeypatch, 0.5, 0.5)
    assert self_test(picture(between, white), 0.1) == 1
    assert not given, "and costs no network"


def test_the_mean_of_what_the_network_says_of_clipped_places() -> None:
    shares = np.zeros((3, 10, 16, 32), np.float32)
    clipped = np.zeros((32, 64), np.float32)
    assert auto_levels.mean_stops(auto_levels.where_clipped(shares, clipped)) == 0, "nothing clips"
    clipped[:, 32:] = 1
    shares[..., :16] = 1  # where nothing clips
    shares[:, :2, :, 16:] = 0.5  # half of it 0.6 stops above white
    assert auto_levels.mean_stops(auto_levels.where_clipped(shares, clipped)) == pytest.approx(0.3)
