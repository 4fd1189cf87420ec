"""Kinds of input that people reported elsewhere as coming out wrong, by their files in ../shared.

Values are those of ../shared/data/field_reports/README.md, of linear light, 1.0 = SDR white.
"""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from clips import SHARED
from stills import linear_srgb

from itmo_video.errors import AlreadyHdrError, InputError
from itmo_video.source.opening import open_clip

REPORTS = SHARED / "data/field_reports"


def report(name: str) -> Path:
    path = REPORTS / name
    if not path.exists():
        pytest.skip(f"{path} is not here")
    return path


def test_01_heif_grids_are_whole() -> None:
    info = open_clip(report("01_heif_grid/arrow.heic")).info
    assert info.display_size == (3024, 4032)
    assert (info.encoding.primaries, info.encoding.transfer) == ("p3d65", "srgb")
    assert open_clip(report("01_heif_grid/sofa_grid1x5_420.avif")).info.display_size == (1024, 770)


def test_02_tiled_tiffs_are_neither_black_nor_green() -> None:
    left = linear_srgb(report("02_tiff_black_green/tiled_made.tif"))[48, 16]
    assert left == pytest.approx((0.5776,) * 3, abs=2e-4)
    checker = linear_srgb(report("02_tiff_black_green/checker.tx"))
    assert checker.mean() == pytest.approx(0.5, abs=0.02)


def test_02_jpeg_in_tiff_is_what_its_tags_say() -> None:
    """Its codes are 200, 200, 200 of Y, Cb and Cr by its TIFF tags and its JPEG header alike.

    libtiff, Pillow, imagecodecs and OpenImageIO agree on 255, 124, 255. The program that made it
    meant grey and stored RGB under a tag that says Y'CbCr.
    """
    left = linear_srgb(report("02_tiff_black_green/jpeg_made.tif"))[48, 16]
    assert left == pytest.approx((1, 0.202, 1), abs=2e-3)


def test_03_avif_keeps_alpha_and_all_frames() -> None:
    assert open_clip(
        report("03_heif_alpha_animation/avif_transparency.avif")
    ).info.encoding.has_alpha
    clip = open_clip(report("03_heif_alpha_animation/colors-animated-8bpc.avif"))
    assert [frame.index for frame in clip.frames()] == list(range(5))
    assert clip.info.frame_rate == 30


@pytest.mark.parametrize(("name", "patch", "want"), [
    ("adobergb.jpg", 5, (0.738, 0.191, 0.098)), ("p3.png", 5, (0.665, 0.171, 0.087)),
    ("linear.tif", None, (0.503,) * 3),
])  # fmt: skip
def test_06_icc_profiles_are_applied(name: str, patch: int | None, want: tuple[float, ...]) -> None:
    rgb = linear_srgb(report(f"06_icc_ignored/{name}"))
    seen = rgb[::8, ::8].reshape(-1, 3)
    assert np.abs(seen - want).max(axis=1).min() < 0.004, "the patch is nowhere"


def test_09_truncated_jpeg_is_refused() -> None:
    with pytest.raises(InputError, match="cut short"):
        open_clip(report("09_truncated_jpeg/cut_full.jpg"))


def test_16_log_dpx_is_refused_as_hdr() -> None:
    with pytest.raises(AlreadyHdrError, match="logarithmic"):
        open_clip(report("16_log_dpx/log_tagged.dpx"))


def test_17_associated_alpha_is_not_multiplied_twice() -> None:
    for name in ("assoc_alpha.tif", "unassoc_alpha.tif"):
        frame = next(iter(open_clip(report(f"17_tiff_assoc_alpha_cmyk/{name}")).frames()))
        top = 2.0**frame.encoding.bit_depth - 1
        half = np.isclose(frame.planes[3] / top, 128 / 255, atol=0.01)
        assert half.any()
        if name == "assoc_alpha.tif":
            assert frame.planes[0][half].max() / top == pytest.approx(1, abs=0.01)


def test_20_small_kinds() -> None:
    clip = open_clip(report("20_small/animated.webp"))
    assert clip.info.frames == len(list(clip.frames())) == 42
    assert clip.info.duration_s == Fraction(283, 100)
    assert open_clip(report("20_small/xmp_no_prefix.jpg")).info.display_size == (1, 1)
