"""A film's colour tags, what is assumed without them, and options that overrule both."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from source_clips import write_planes, write_streams

from itmo_video.errors import AlreadyHdrError, InputError
from itmo_video.source.opening import open_clip
from itmo_video.source.tags import InputOptions


def tagged(tmp_path: Path, **tags: int) -> Path:
    """A clip of one grey frame with these tags."""
    planes = [np.full((4, 8), 100, np.uint8), *[np.full((2, 4), 128, np.uint8)] * 2]
    return write_planes(tmp_path / "t.mkv", "yuv420p", planes, **tags)


@pytest.mark.parametrize(("trc", "transfer"), [
    (1, "bt1886"), (6, "bt1886"), (14, "bt1886"), (13, "srgb"), (4, "gamma22"), (2, "bt1886"),
])  # fmt: skip
def test_transfer_tags(tmp_path: Path, trc: int, transfer: str) -> None:
    enc = open_clip(tagged(tmp_path, color_trc=trc)).info.encoding
    assert enc.transfer == transfer
    assert enc.origins["transfer"] == ("assumed" if trc == 2 else "tag")


@pytest.mark.parametrize("trc", [8, 9, 10, 16, 18])
def test_hdr_tags_are_refused_unless_overruled(tmp_path: Path, trc: int) -> None:
    path = tagged(tmp_path, color_trc=trc)
    with pytest.raises(AlreadyHdrError, match="--force-sdr"):
        open_clip(path)
    assert open_clip(path, InputOptions(force_sdr=True)).info.encoding.transfer == "bt1886"
    enc = open_clip(path, InputOptions(transfer="gamma22")).info.encoding
    assert (enc.transfer, enc.origins["transfer"]) == ("gamma22", "set")


def test_options_overrule_tags(tmp_path: Path) -> None:
    path = tagged(tmp_path, colorspace=1, color_range=1)
    enc = open_clip(path, InputOptions(matrix="bt2020", range="full")).info.encoding
    assert (enc.matrix, enc.range) == ("bt2020", "full")
    assert (enc.origins["matrix"], enc.origins["range"]) == ("set", "set")


def test_unknown_matrix_needs_the_users_word(tmp_path: Path) -> None:
    path = tagged(tmp_path, colorspace=8)
    with pytest.raises(InputError, match="YCgCo"):
        open_clip(path)
    assert open_clip(path, InputOptions(matrix="bt709")).info.encoding.matrix == "bt709"


@pytest.mark.parametrize("primaries", [(1, "rec709"), (5, "rec601_625"), (6, "rec601_525"),
    (9, "rec2020"), (12, "p3d65"), (2, "rec709")])  # fmt: skip
def test_primaries_tags(tmp_path: Path, primaries: tuple[int, str]) -> None:
    number, name = primaries
    assert open_clip(tagged(tmp_path, color_primaries=number)).info.encoding.primaries == name


@pytest.mark.parametrize(("size", "matrix"), [
    ((1280, 534), "bt709"), ((720, 576), "bt601"), ((720, 480), "bt601"), ((1024, 578), "bt709"),
    ((960, 540), "bt601"), ((1280, 64), "bt709"),
])  # fmt: skip
def test_matrix_of_untagged_films(tmp_path: Path, size: tuple[int, int], matrix: str) -> None:
    assert open_clip(write_streams(tmp_path / "a.mkv", [size])).info.encoding.matrix == matrix
