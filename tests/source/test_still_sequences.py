"""Sequences of stills: numbers, gaps, damage, and images of several kinds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import tifffile
from image_files import picture, write_image, written
from PIL import Image
from source_clips import read
from stills import encoded, noise

from itmo_video.errors import DamagedInputError
from itmo_video.source.opening import open_clip


@pytest.mark.parametrize("pattern", ["img.%04d.png", "img.####.png"])
def test_sequences_keep_their_numbers_and_holes(tmp_path: Path, pattern: str) -> None:
    images = {n: picture(seed=n) for n in (8, 9, 10, 12, 10000)}
    del images[10000]
    for n, image in images.items():
        write_image(tmp_path / f"img.{n:04d}.png", image)
    write_image(tmp_path / "img.99.png", picture())  # too few digits for the pattern
    clip = open_clip(tmp_path / pattern)
    info = clip.info
    assert (info.frames, info.first_number, info.stem) == (5, 8, "img")
    for start in range(6):
        found = read(clip, start)
        assert list(found) == [n - 8 for n in images if n - 8 >= start]
        for index, frame in found.items():
            np.testing.assert_array_equal(np.stack(frame.planes, -1), images[index + 8][..., ::-1])
            assert frame.time_s == index / info.frame_rate


def test_sequences_skip_damaged_images_and_refuse_other_sizes(tmp_path: Path) -> None:
    for n in range(3):
        write_image(tmp_path / f"{n}.png", picture(seed=n))
    (tmp_path / "1.png").write_bytes(b"\x89PNG\r\n\x1a\nrubbish")
    clip = open_clip(tmp_path / "%d.png")
    assert list(read(clip)) == [0, 2]
    write_image(tmp_path / "3.png", picture(height=10))
    with pytest.raises(DamagedInputError, match="38x10") as caught:
        list(open_clip(tmp_path / "%d.png").frames())
    assert "3.png" in str(caught.value)


def test_cut_stills_are_gaps_of_a_sequence(tmp_path: Path) -> None:
    for n in range(4):
        data = encoded(noise(seed=n), "JPEG")
        written(tmp_path / f"s.{n:04d}.jpg", data[: len(data) // 2] if n == 2 else data)
    clip = open_clip(tmp_path / "s.%04d.jpg")
    assert [frame.index for frame in clip.frames()] == [0, 1, 3]
    assert "s.0002.jpg" in clip.faults[2]


def test_mixed_depths_and_kinds_of_a_sequence_are_each_read_by_their_own(tmp_path: Path) -> None:
    image = noise()
    Image.fromarray(image).save(tmp_path / "0.png")
    tifffile.imwrite(tmp_path / "deep.tif", image.astype(np.uint16) * 257, photometric="rgb")
    (tmp_path / "deep.tif").rename(tmp_path / "1.png")
    Image.fromarray(image[..., 0]).save(tmp_path / "2.png")
    frames = list(open_clip(tmp_path / "%d.png").frames())
    assert [f.encoding.bit_depth for f in frames] == [8, 16, 8]
    assert [f.encoding.family for f in frames] == ["rgb", "rgb", "grey"]


def test_gaps_of_a_sequence_are_told_by_number(tmp_path: Path) -> None:
    for n in (3, 4, 7):
        Image.fromarray(noise()).save(tmp_path / f"{n}.png")
    assert any(
        "missing from the sequence: 5, 6" in n for n in open_clip(tmp_path / "%d.png").info.notices
    )
