"""Frames too large to be read back are refused before they are written."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from clips import moving_scene, write_ffv1

from itmo_video import UsageError, make_settings, open_clip
from itmo_video.conversion.file_size import check_file_size
from itmo_video.output.exr_claims import MOST_PIXEL_BYTES


def test_as_many_bytes_as_are_read_back(tmp_path: Path) -> None:
    with open_clip(write_ffv1(tmp_path / "c.mkv", moving_scene(1, width=32, height=24))) as clip:
        info = clip.info
    layers = make_settings(layers=["expand_map"])
    height = MOST_PIXEL_BYTES // (6 * 10000)
    large = replace(info, width=10000, height=height)
    check_file_size(large, make_settings())
    for settings, rows in ((make_settings(), height + 1), (layers, height)):
        with pytest.raises(UsageError, match=r"larger than 1\.25 GB, the most that is read back"):
            check_file_size(replace(large, height=rows), settings)
    check_file_size(replace(large, height=height * 3 // 4), layers)
