"""TIFF: tiles, compressions, depths, associated alpha, and a JPEG inside."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
from image_files import codes_of, written
from PIL import Image
from stills import encoded, linear_srgb, noise

from itmo_video.errors import AlreadyHdrError, InputError
from itmo_video.model import Code
from itmo_video.source.opening import open_clip


@pytest.mark.parametrize("options", [
    {}, {"tile": (16, 16)}, {"tile": (32, 16), "compression": "zlib", "predictor": True},
    {"compression": "zlib"}, {"planarconfig": "separate", "tile": (16, 16)}, {"bigtiff": True},
    {"byteorder": ">"},
])  # fmt: skip
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_tiff_layouts_are_exact(tmp_path: Path, options: dict[str, Any], dtype: type) -> None:
    image = np.random.default_rng(3).integers(0, np.iinfo(dtype).max, (48, 64, 3), dtype)
    stored = np.moveaxis(image, -1, 0) if "planarconfig" in options else image
    path = tmp_path / "a.tif"
    tifffile.imwrite(path, stored, photometric="rgb", **options)
    np.testing.assert_array_equal(codes_of(path), image)


@pytest.mark.parametrize("compression", ["tiff_lzw", "tiff_adobe_deflate", "packbits"])
def test_tiff_compressions_are_exact(tmp_path: Path, compression: str) -> None:
    image = noise()
    path = written(tmp_path / "a.tif", encoded(image, "TIFF", compression=compression))
    np.testing.assert_array_equal(codes_of(path), image)


def test_jpeg_in_tiff(tmp_path: Path) -> None:
    image = np.full((64, 64, 3), (200, 80, 40), np.uint8)
    path = written(tmp_path / "a.tif", encoded(image, "TIFF", compression="jpeg"))
    np.testing.assert_allclose(codes_of(path), image, atol=3)


def test_tiff_of_floats_is_hdr_and_of_sensor_data_is_refused(tmp_path: Path) -> None:
    tifffile.imwrite(tmp_path / "f.tif", np.ones((8, 8, 3), np.float32), photometric="rgb")
    with pytest.raises(AlreadyHdrError, match="floating-point"):
        open_clip(tmp_path / "f.tif")
    extra = [(50706, "B", 4, (1, 4, 0, 0), True)]
    tifffile.imwrite(tmp_path / "a.dng", np.ones((8, 8), np.uint16), extratags=extra)
    with pytest.raises(InputError, match="raw file"):
        open_clip(tmp_path / "a.dng")
    tifffile.imwrite(tmp_path / "t.tif", np.ones((8, 8), np.uint8), subfiletype=1)
    with pytest.raises(InputError, match="thumbnail"):
        open_clip(tmp_path / "t.tif")


def test_pages_beyond_the_first_are_told(tmp_path: Path) -> None:
    tifffile.imwrite(tmp_path / "a.tif", np.ones((3, 8, 8, 3), np.uint8), photometric="rgb")
    assert any("several pages" in n for n in open_clip(tmp_path / "a.tif").info.notices)


# ---- alpha ----


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_associated_alpha_is_divided_out(tmp_path: Path, dtype: type) -> None:
    top = np.iinfo(dtype).max
    straight = np.full((8, 8, 4), (top, top // 2, top // 5, top // 2), np.float64)
    premultiplied = straight.copy()
    premultiplied[..., :3] *= straight[..., 3:] / top
    for kind, image in (("assocalpha", premultiplied), ("unassalpha", straight)):
        path = tmp_path / f"{kind}.tif"
        tifffile.imwrite(path, np.rint(image).astype(dtype), photometric="rgb", extrasamples=[kind])
        got = codes_of(path).astype(float)
        got *= top / (65535 if got.max() > top else top)
        np.testing.assert_allclose(got, straight, atol=1.5)
    clear: Code = np.zeros((4, 4, 4), dtype)
    tifffile.imwrite(path, clear, photometric="rgb", extrasamples=["assocalpha"])
    assert not codes_of(path).any()


@pytest.mark.parametrize("rows", [8, 48])
def test_a_jpeg_in_a_tiff_that_ends_early_is_damage(tmp_path: Path, rows: int) -> None:
    """libtiff fills the rest of such a strip with a plain colour and says nothing."""
    data = io.BytesIO()
    noisy = Image.fromarray(noise(48, 64))
    noisy.save(data, "TIFF", compression="jpeg", tiffinfo={278: rows})
    whole = data.getvalue()
    assert linear_srgb(written(tmp_path / "a.tif", whole)).shape == (48, 64, 3)
    end = whole.index(b"\xff\xd9", whole.index(b"\xff\xda"))  # of the first strip's scan
    cut = whole[: end - 60] + b"\0" * 62 + whole[end + 2 :]
    assert len(cut) == len(whole)
    with pytest.raises(InputError, match="strip or tile 1 is damaged"):
        linear_srgb(written(tmp_path / "cut.tif", cut))
