"""Every size of picture: no crash, and the same bytes whatever the number of workers."""

from __future__ import annotations

import itertools
import random
from pathlib import Path

import cv2
import numpy as np
import pytest
from clips import exr_bytes, moving_scene, write_ffv1
from command import run

from itmo_video import RunOptions, convert, make_settings
from itmo_video.motion.flow import bears_quarter_size, flow_px

RNG = random.Random(22)
STRIPS = [
    *((RNG.randint(1, 100), RNG.randint(200, 600)) for _ in range(30)),
    *((RNG.randint(200, 600), RNG.randint(1, 100)) for _ in range(30)),
]
SQUARES = list(itertools.product(range(1, 41), range(1, 41)))


def two_frames(height: int, width: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng((height, width))
    ground = cv2.blur(rng.integers(0, 256, (height + 4, width + 4), dtype=np.uint8), (3, 3))
    here = np.ascontiguousarray(ground[:height, :width])
    return here, np.ascontiguousarray(ground[1 : 1 + height, 2 : 2 + width])


@pytest.mark.parametrize("sizes", [SQUARES, STRIPS], ids=["squares", "strips"])
def test_flow_is_the_same_the_second_time(sizes: list[tuple[int, int]]) -> None:
    for height, width in sizes:
        here, there = two_frames(height, width)
        first = flow_px(here, there)
        assert first.shape == (height, width, 2)
        assert np.isfinite(first).all(), (height, width)
        flow_px(there, here)
        assert np.array_equal(flow_px(here, there), first), (height, width)


def test_what_the_scales_are_taken_by_is_opencvs_own_rule() -> None:
    """Where it says that FAST's finest scale holds, a call leaves the object's scale as it was."""
    for height, width in [*STRIPS, (31, 512), (32, 90), (32, 91), (33, 512), (64, 64), (91, 32)]:
        if min(height, width) < 32 and max(height, width) > 200:
            continue  # there OpenCV crashes if asked
        dis = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_FAST)
        if min(height, width) < 16:
            continue
        dis.calc(*two_frames(height, width), None)
        assert (dis.getFinestScale() == 2) == bears_quarter_size(height, width), (height, width)


def test_crashing_sizes_are_converted(tmp_path: Path) -> None:
    """In processes of their own: what they did was a segmentation fault."""
    for height, width in ((24, 512), (25, 512), (16, 640), (20, 900)):
        clip = write_ffv1(tmp_path / f"{height}.mkv", moving_scene(8, width=width, height=height))
        done = run("convert", clip, tmp_path / f"o{height}", "--quiet", "--compression", "none")
        assert done.returncode == 0, done.stderr
        assert len(exr_bytes(tmp_path / f"o{height}")) == 8


SOME = [
    *RNG.sample([s for s in SQUARES if min(s) >= 16], 8), *RNG.sample(SQUARES, 12),
    (1, 1), (1, 2), (2, 1), (1, 40), (40, 1), (200, 24), (400, 20), (48, 80), (24, 300), (100, 512),
]  # fmt: skip


@pytest.mark.parametrize(("height", "width"), SOME, ids=lambda n: str(n))
def test_any_size_any_number_of_jobs(height: int, width: int, tmp_path: Path) -> None:
    clip = tmp_path / "c.%d.png"  # FFV1 has a least size, PNG has none
    for n, codes in enumerate(moving_scene(9, width=width, height=height, cuts=(5,))):
        cv2.imwrite(str(clip) % n, codes)
    settings = make_settings(key_interval=4, smooth_keys=1, lights=16, compression="none")
    made = []
    for jobs in (1, 2, 7):
        out = tmp_path / str(jobs)
        convert(clip, out, settings, RunOptions(jobs=jobs))
        made.append(exr_bytes(out))
    assert len(made[0]) == 9
    assert made[0] == made[1] == made[2]
