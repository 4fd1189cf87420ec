"""Pictures upright and whole: turns, flips, and interlaced fields."""

from __future__ import annotations

import itertools
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from clips import film_encoding
from oracles import to_rgb_code
from source_clips import DATA, read, same, write_scene

from itmo_video.model import ChromaSiting, Code, Encoding, Frame
from itmo_video.source import planes, tags
from itmo_video.source.opening import open_clip
from itmo_video.source.tags import InputOptions

ALL_TURNS = list(itertools.product((0, 90, 180, 270), (False, True)))


@pytest.mark.parametrize("turn", ALL_TURNS)
@pytest.mark.parametrize("size", [(12, 8), (13, 8), (12, 7), (13, 7)])
@pytest.mark.parametrize(("layout", "siting"), [
    ("420", "left"), ("420", "center"), ("420", "topleft"), ("422", "left"), ("444", "left"),
])  # fmt: skip
def test_turning_planes_turns_the_picture(
    turn: tuple[int, bool], size: tuple[int, int], layout: str, siting: ChromaSiting
) -> None:
    rng = np.random.default_rng(8)
    across, down = {"420": (2, 2), "422": (2, 1), "444": (1, 1)}[layout]
    small = (-(-size[1] // down), -(-size[0] // across))
    stored = tuple(
        rng.integers(30, 220, shape, dtype=np.uint8) for shape in (size[::-1], small, small)
    )
    enc = film_encoding(siting=siting)
    frame = planes_frame(stored, enc)
    want = np.stack(to_rgb_code(frame))
    if turn[1]:
        want = want[:, :, ::-1]
    want = np.rot90(want, -turn[0] // 90, axes=(1, 2))
    got = np.stack(to_rgb_code(planes_frame(*planes.upright(stored, turn, enc))))
    np.testing.assert_allclose(got, want, atol=1e-5)


def planes_frame(stored: tuple[Code, ...], enc: Encoding) -> Frame:
    return Frame(0, Fraction(0), stored, enc)


@pytest.mark.parametrize("turn", ALL_TURNS)
def test_display_matrices(turn: tuple[int, bool]) -> None:
    angle, flip = np.radians(turn[0]), turn[1]
    mirror = np.diag([-1.0 if flip else 1.0, 1.0])
    rotate = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    (a, b), (c, d) = np.round(mirror @ rotate * 65536).astype(int)
    assert tags.matrix_turn([a, b, 0, c, d, 0, 0, 0, 1 << 30]) == turn


@pytest.mark.shared
def test_flagged_fields_are_deinterlaced_and_said() -> None:
    path = DATA / "odd_clips/interlaced_tff_h264.mp4"
    kept = next(open_clip(path, InputOptions(deinterlace="off")).frames(7))
    made = next(open_clip(path).frames(7))

    def comb(frame: Frame) -> float:
        luma = frame.planes[0].astype(float)
        return float(np.abs(luma[1:-1] - (luma[:-2] + luma[2:]) / 2).mean())

    assert comb(made) < 0.8 * comb(kept)
    assert any("deinterlaced" in notice for notice in open_clip(path).info.notices)
    assert made.time_s == kept.time_s


def test_progressive_clips_are_deinterlaced_by_force_only(tmp_path: Path) -> None:
    path = write_scene(tmp_path / "a.mp4", "libx264", 8)
    plain, forced = (read(open_clip(path, InputOptions(deinterlace=m))) for m in ("auto", "force"))
    assert list(plain) == list(forced) == list(range(8))
    assert not same(plain[3], forced[3])
