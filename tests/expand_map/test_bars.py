"""Bars are found, and nothing else is taken for them."""

from __future__ import annotations

import numpy as np
import pytest
from clips import still_encoding
from hypothesis import given
from hypothesis import strategies as st

from itmo_video.expand_map.letterbox import Bars, find_bars

NONE = Bars(0, 0, 0, 0)


def picture(height: int = 120, width: int = 200) -> np.ndarray:
    return np.random.default_rng(0).uniform(0.01, 1, (height, width)).astype(np.float32)


@given(st.integers(3, 30), st.integers(0, 1))
def test_letterbox_and_pillarbox(size: int, uneven: int) -> None:
    boxed = picture()
    boxed[:size] = boxed[120 - size - uneven :] = 0
    assert find_bars(boxed) == Bars(size, size + uneven, 0, 0)
    boxed = picture()
    boxed[:, :size] = boxed[:, 200 - size - uneven :] = 0
    expected = NONE if size < 4 else Bars(0, 0, size, size + uneven)
    assert find_bars(boxed) == expected


def test_both_at_once_and_with_codec_noise() -> None:
    boxed = np.full((120, 200), 2e-5, np.float32)
    boxed[12:108, 20:180] = picture(96, 160)
    assert find_bars(boxed) == Bars(12, 12, 20, 20)


@pytest.mark.parametrize("kind", ["black", "white", "lamps", "one side", "picture", "dark"])
def test_what_is_no_bar(kind: str) -> None:
    image = picture()
    if kind == "black":
        image[:] = 0
    elif kind == "white":
        image[:] = 1
    elif kind == "lamps":
        image[:] = 0
        image[50:70, 80:120] = 1
    elif kind == "one side":
        image[:20] = 0
    elif kind == "dark":
        image[:50] = image[70:] = 0
    assert find_bars(image) == NONE, f"{kind} was taken for bars"


def test_a_boxed_picture_has_the_map_of_the_picture_alone() -> None:
    from fractions import Fraction

    from itmo_video.expand_map.key_map import make_key_map
    from itmo_video.look import make_look
    from itmo_video.model import Frame
    from itmo_video.presets import make_settings

    encoding = still_encoding("grey")
    y, x = np.mgrid[0:160, 0:320]
    codes = (60 + 40 * np.sin(x / 30) * np.cos(y / 20)).astype(np.uint8)
    codes[np.hypot(x - 100, y - 80) < 20] = 255
    boxed = np.zeros((200, 320), np.uint8)
    boxed[20:180] = codes
    look = make_look(make_settings("paper"))
    alone = make_key_map(Frame(0, Fraction(0), (codes,), encoding), look)
    both = make_key_map(Frame(0, Fraction(0), (boxed,), encoding), look)
    assert alone.max() > 0.5
    np.testing.assert_array_equal(both[20:180], alone)
    assert not both[:20].any()
    assert not both[180:].any()
