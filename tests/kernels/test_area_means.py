"""Averages over areas: the compiled form has OpenCV's bytes, for any size and kind of plane."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from compiled_kernels import loaded, needs_kernels

from itmo_video.colour.analysis_picture import area_means, averaged
from itmo_video.kernels import compiled_area, library

SIZES = [  # from (height, width) to (width, height)
    ((540, 960), (512, 288)),
    ((360, 640), (512, 288)),
    ((270, 641), (512, 215)),
    ((17, 33), (31, 9)),
    ((7, 9), (2, 1)),
    ((100, 60), (59, 33)),
    ((35, 24), (8, 12)),  # one side by a whole factor
    ((35, 25), (5, 7)),  # both
    ((9, 20), (30, 12)),  # larger
]


@needs_kernels
@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.float32])
@pytest.mark.parametrize(("shape", "size"), SIZES, ids=str)
def test_bytes_are_opencvs(
    shape: tuple[int, int], size: tuple[int, int], kind: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    top = 1 if kind is np.float32 else np.iinfo(kind).max
    planes = (np.random.default_rng(5).random((shape[0], shape[1] + 3, 3)) * top).astype(kind)
    plane = planes[..., 1].copy()[:, : shape[1]]  # lines with gaps, as a decoder's
    planes = planes[:, : shape[1]]
    ours, three = averaged(plane, size), area_means(planes, size)
    monkeypatch.setattr(library, "library", lambda: None)
    assert np.array_equal(ours, averaged(plane, size))
    assert ours.shape == size[::-1]
    assert np.array_equal(three, area_means(planes, size))
    assert three.shape == (*size[::-1], 3)


@needs_kernels
def test_a_mean_lies_within_its_plane() -> None:
    assert np.array_equal(
        np.unique(averaged(np.full((540, 960), 211, np.uint8), (512, 288))), [211]
    )


@needs_kernels
def test_larger_sizes_raise() -> None:
    assert loaded is not None
    with pytest.raises(ValueError, match="averaged"):
        compiled_area.area_means(loaded, np.zeros((4, 4), np.uint8), (5, 3))
