"""Stills that are cut, too large, or of a kind that is not read: refused, never passed."""

from __future__ import annotations

import io
import struct
from pathlib import Path

import numpy as np
import pillow_heif
import pytest
from image_files import chunk, codes_of, written
from PIL import Image
from stills import encoded, noise

from itmo_video.errors import AlreadyHdrError, InputError
from itmo_video.source import still_formats
from itmo_video.source.opening import open_clip
from itmo_video.source.tags import InputOptions

FORMS: dict[str, tuple[str, dict[str, object]]] = {
    "jpg": ("JPEG", {"quality": 90}), "progressive.jpg": ("JPEG", {"progressive": True}),
    "png": ("PNG", {}), "raw.tif": ("TIFF", {}), "lzw.tif": ("TIFF", {"compression": "tiff_lzw"}),
    "webp": ("WEBP", {}), "lossless.webp": ("WEBP", {"lossless": True}), "gif": ("GIF", {}),
    "bmp": ("BMP", {}), "ppm": ("PPM", {}), "jp2": ("JPEG2000", {}), "avif": ("AVIF", {}),
    "heic": ("HEIF", {}), "qoi": ("QOI", {}),
}  # fmt: skip


@pytest.mark.parametrize("name", FORMS)
def test_cut_stills_never_pass(tmp_path: Path, name: str) -> None:
    """Nowhere may a cut file give another picture than the whole one."""
    pillow_heif.register_heif_opener()
    form, options = FORMS[name]
    data = encoded(noise(64, 96), form, **options)
    path = written(tmp_path / f"whole.{name}", data)
    whole = codes_of(path)
    cut = tmp_path / f"cut.{name}"
    for part in range(1, 24):
        cut.write_bytes(data[: len(data) * part // 24])
        try:
            got = codes_of(cut)
        except InputError:
            continue
        assert got.shape == whole.shape
        assert np.abs(got.astype(float) - whole).max() < 2, f"{part}/24 of it passes"


@pytest.mark.parametrize("form", ["HEIF", "AVIF"])
def test_a_cut_box_is_damage(tmp_path: Path, form: str) -> None:
    """As of a grid whose last tiles are cut off: a library shows the rest."""
    pillow_heif.register_heif_opener()
    data = encoded(noise(64, 96), form)
    for part in (len(data) - 1, len(data) - 40, len(data) // 2):
        with pytest.raises(InputError, match="truncated"):
            open_clip(written(tmp_path / "a", data[:part]))


def test_png_check_sums_are_checked(tmp_path: Path) -> None:
    data = bytearray(encoded(noise(), "PNG"))
    data[data.find(b"IDAT") + 40] ^= 1
    with pytest.raises(InputError, match="IDAT at byte"):
        open_clip(written(tmp_path / "a.png", bytes(data)))


def test_sizes_are_read_before_anything_is_decoded() -> None:
    image = Image.fromarray(noise(31, 45))
    for form, kind in (
        ("PNG", "png"), ("WEBP", "webp"), ("GIF", "gif"), ("JPEG2000", "jpeg2000"), ("QOI", "qoi"),
    ):  # fmt: skip
        for lossless in (False, True) if form == "WEBP" else (False,):
            data = io.BytesIO()
            image.save(data, form, **({"lossless": True} if lossless else {}))
            head = data.getvalue()
            assert still_formats.still_format(head[:4096]) == kind
            assert still_formats.stated_size(head, kind) == (45, 31)


@pytest.mark.parametrize("name", FORMS)
def test_max_pixels_holds_for_every_format(tmp_path: Path, name: str) -> None:
    pillow_heif.register_heif_opener()
    form, options = FORMS[name]
    path = written(tmp_path / f"a.{name}", encoded(noise(32, 48), form, **options))
    with pytest.raises(InputError, match="--max-pixels"):
        open_clip(path, InputOptions(max_pixels=32 * 48 - 1))
    assert open_clip(path, InputOptions(max_pixels=32 * 48)).info.width == 48


def test_bombs_are_refused_unopened(tmp_path: Path) -> None:
    head = chunk(b"IHDR", struct.pack(">IIBBBBB", 60000, 60000, 8, 2, 0, 0, 0))
    png = b"\x89PNG\r\n\x1a\n" + head + chunk(b"IDAT", b"") + chunk(b"IEND", b"")
    webp = b"RIFF" + struct.pack("<I", 30) + b"WEBPVP8X" + struct.pack("<I", 10) + bytes(4)
    webp += (16382).to_bytes(3, "little") * 2
    pnm = b"P6 60000 60000 255\n"
    gif = b"GIF89a" + struct.pack("<HH", 65535, 65535) + bytes(20)
    for name, data in (("a.png", png), ("a.webp", webp), ("a.ppm", pnm), ("a.gif", gif)):
        with pytest.raises(InputError, match=r"--max-pixels|claims"):
            open_clip(written(tmp_path / name, data))


# ---- what is not read ----


def test_unread_formats_are_refused_in_words(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="JPEG XL"):
        open_clip(written(tmp_path / "a.jxl", b"\xff\x0a" + bytes(50)))
    with pytest.raises(AlreadyHdrError, match="Cineon"):
        open_clip(written(tmp_path / "a.cin", b"\x80\x2a\x5f\xd7" + bytes(2000)))
    cmyk = io.BytesIO()
    Image.new("CMYK", (8, 8), (255, 0, 0, 0)).save(cmyk, "JPEG")
    with pytest.raises(InputError, match="CMYK"):
        open_clip(written(tmp_path / "a.jpg", cmyk.getvalue()))
    Image.new("CMYK", (8, 8), (255, 0, 0, 0)).save(tmp_path / "a.tif")
    with pytest.raises(InputError, match="CMYK"):
        open_clip(tmp_path / "a.tif")


def test_damaged_stills_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    path.write_bytes(b"\x89PNG\r\n\x1a\nrubbish that goes on for a while")
    with pytest.raises(InputError, match="cannot be decoded"):
        open_clip(path)
