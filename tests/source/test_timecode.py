"""Timecodes against SMPTE 12M's published properties."""

from __future__ import annotations

from fractions import Fraction

import pytest

from itmo_video.source.timecode import advance

NTSC = Fraction(30000, 1001)


@pytest.mark.parametrize(
    ("start", "frames", "rate", "expected"),
    [
        ("00:00:00:00", 0, Fraction(24), "00:00:00:00"),
        ("01:00:00:00", 25, Fraction(24), "01:00:01:01"),
        ("23:59:59:23", 1, Fraction(24), "00:00:00:00"),
        ("00:00:59;29", 1, NTSC, "00:01:00;02"),
        ("00:09:59;29", 1, NTSC, "00:10:00;00"),
        ("00:00:00;00", 17982, NTSC, "00:10:00;00"),
        ("00:00:00;00", 107892, NTSC, "01:00:00;00"),
        ("00:00:59:29", 1, NTSC, "00:01:00:00"),
        ("00:00:59;59", 1, Fraction(60000, 1001), "00:01:00;04"),
    ],
)
def test_published_steps(start: str, frames: int, rate: Fraction, expected: str) -> None:
    assert advance(start, frames, rate) == expected


def test_what_is_no_timecode_gives_none() -> None:
    assert advance("yesterday", 1, NTSC) is None


def test_drop_frame_counts_on_by_one_through_a_day() -> None:
    code = "00:00:00;00"
    seen = {code}
    for _ in range(20000):
        following = advance(code, 1, NTSC)
        assert following is not None
        code = following
        assert code not in seen, f"{code} came twice"
        seen.add(code)
    assert code == advance("00:00:00;00", 20000, NTSC)
