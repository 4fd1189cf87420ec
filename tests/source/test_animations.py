"""Animations: every frame with its time, and ones that are cut."""

from __future__ import annotations

import io
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from image_files import written
from PIL import Image
from stills import encoded, noise

from itmo_video.errors import InputError
from itmo_video.source.opening import open_clip

FRAMES = [np.full((24, 32, 3), (40 * n, 200 - 30 * n, 90), np.uint8) for n in range(5)]
LENGTHS_MS = [100, 40, 250, 60, 90]


@pytest.mark.parametrize("form", ["GIF", "WEBP", "PNG", "AVIF"])
def test_animations_have_all_frames_and_times(tmp_path: Path, form: str) -> None:
    options: dict[str, object] = {"save_all": True, "duration": LENGTHS_MS}
    if form == "WEBP":
        options["lossless"] = True
    if form == "AVIF":
        options["quality"] = 100
    options["append_images"] = [Image.fromarray(f) for f in FRAMES[1:]]
    path = written(tmp_path / "a", encoded(FRAMES[0], form, **options))
    clip = open_clip(path)
    assert clip.info.frames == 5
    assert clip.info.is_vfr
    assert clip.info.duration_s == Fraction(sum(LENGTHS_MS), 1000)
    for start in range(5):
        found = list(clip.frames(start))
        assert [f.index for f in found] == list(range(start, 5))
        for frame in found:
            assert frame.time_s == clip.time_s(frame.index)
            assert frame.time_s == Fraction(sum(LENGTHS_MS[: frame.index]), 1000)
            np.testing.assert_allclose(np.dstack(frame.planes), FRAMES[frame.index], atol=4)


@pytest.mark.parametrize("form", ["GIF", "WEBP", "PNG"])
def test_cut_animations_are_damaged(tmp_path: Path, form: str) -> None:
    frames = [Image.fromarray(noise(seed=n)) for n in range(6)]
    data = io.BytesIO()
    frames[0].save(data, form, save_all=True, append_images=frames[1:], duration=100)
    path = written(tmp_path / "a", data.getvalue()[: len(data.getvalue()) * 2 // 3])
    try:
        clip = open_clip(path)
    except InputError:
        return
    found = list(clip.frames())
    assert len(found) < 6
    assert (clip.info.frames_declared or 0) > len(found)


def test_still_gif_is_a_still(tmp_path: Path) -> None:
    image = np.zeros((8, 8, 3), np.uint8)
    path = written(tmp_path / "a.gif", encoded(image, "GIF"))
    assert (open_clip(path).info.container, open_clip(path).info.frames) == ("image", 1)
