"""Stills: exact pixels, depth, alpha and orientation of each format."""

from __future__ import annotations

import itertools
import struct
from pathlib import Path

import cv2
import numpy as np
import pillow_heif
import pytest
from image_files import codes_of, exif, picture, png_bytes, write_image, written
from oracles import to_rgb_code
from PIL import Image
from stills import encoded, noise

from itmo_video.source.opening import open_clip
from itmo_video.source.tags import InputOptions


@pytest.mark.parametrize(("ext", "dtype"), [*itertools.product((".png", ".tiff", ".ppm"),
    (np.uint8, np.uint16)), (".bmp", np.uint8)])  # fmt: skip
def test_lossless_stills_are_exact(
    tmp_path: Path, ext: str, dtype: type[np.uint8 | np.uint16]
) -> None:
    image = picture(dtype=dtype)
    clip = open_clip(write_image(tmp_path / f"still{ext}", image))
    (frame,) = clip.frames()
    assert (clip.info.frames, clip.info.first_number, clip.info.stem) == (1, None, "still")
    assert (frame.encoding.family, frame.encoding.transfer) == ("rgb", "srgb")
    assert (frame.encoding.range, frame.encoding.bit_depth) == ("full", 8 * dtype().itemsize)
    np.testing.assert_array_equal(np.stack(frame.planes, -1), image[..., ::-1])
    assert list(clip.frames(1)) == []


def test_grey_alpha_and_palette_pngs(tmp_path: Path) -> None:
    grey = picture(channels=1)
    frame = next(open_clip(write_image(tmp_path / "grey.png", grey)).frames())
    assert frame.encoding.family == "grey"
    np.testing.assert_array_equal(frame.planes[0], grey)
    rgba = picture(channels=4)
    frame = next(open_clip(write_image(tmp_path / "rgba.png", rgba)).frames())
    assert frame.encoding.has_alpha
    np.testing.assert_array_equal(np.stack(frame.planes, -1), rgba[..., [2, 1, 0, 3]])
    palette = bytes(range(30, 60))
    rows = b"".join(b"\0" + bytes([y, (y + 3) % 10, 9]) for y in range(4))
    for name, extra, alpha in (("a", (), False), ("b", ((b"tRNS", b"\x80"),), True)):
        path = tmp_path / f"{name}.png"
        path.write_bytes(png_bytes(3, 4, 3, rows, (b"PLTE", palette), *extra))
        frame = next(open_clip(path).frames())
        assert (frame.encoding.family, frame.encoding.has_alpha) == ("rgb", alpha)
        assert [int(plane[1, 2]) for plane in frame.planes[:3]] == [57, 58, 59]
        if alpha:
            assert int(frame.planes[3][0, 0]) == 0x80


def test_jpeg_comes_as_srgb(tmp_path: Path) -> None:
    image = np.full((32, 48, 3), (40, 90, 200), np.uint8)
    clip = open_clip(write_image(tmp_path / "a.jpg", image))
    enc = clip.info.encoding
    assert (enc.family, enc.range, enc.transfer, enc.primaries) == ("rgb", "full", "srgb", "rec709")
    told = open_clip(tmp_path / "a.jpg", InputOptions(matrix="bt709")).info.notices
    assert any("ignored" in notice for notice in told)
    got = np.stack(to_rgb_code(next(clip.frames())), -1) * 255
    np.testing.assert_allclose(got, np.broadcast_to((200, 90, 40), got.shape), atol=1.5)


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("size", [(24, 38), (21, 33)])
def test_exif_orientation(tmp_path: Path, orientation: int, size: tuple[int, int]) -> None:
    smooth = cv2.resize(picture(3, 4), size[::-1], interpolation=cv2.INTER_CUBIC)
    data = cv2.imencode(".jpg", smooth, [cv2.IMWRITE_JPEG_QUALITY, 98])[1].tobytes()
    body = b"Exif\0\0" + exif(orientation)
    path = tmp_path / "a.jpg"
    path.write_bytes(data[:2] + b"\xff\xe1" + struct.pack(">H", len(body) + 2) + body + data[2:])
    shown = cv2.imread(str(path))
    assert shown is not None
    want = shown[..., ::-1]
    clip = open_clip(path)
    frame = next(clip.frames())
    assert frame.size == clip.info.display_size == (want.shape[1], want.shape[0])
    got = np.stack(to_rgb_code(frame), -1) * 255
    assert np.abs(got - want).mean() < 3
    png = tmp_path / "a.png"
    rows = b"".join(b"\0" + row.tobytes() for row in smooth[..., ::-1])
    png.write_bytes(png_bytes(size[1], size[0], 2, rows, (b"eXIf", exif(orientation))))
    turned = np.stack(next(open_clip(png).frames()).planes, -1)
    assert np.abs(turned.astype(float) - want).mean() < 3


@pytest.mark.parametrize(("form", "options"), [
    ("PNG", {}), ("WEBP", {"lossless": True, "exact": True}), ("TIFF", {}), ("JPEG2000", {}),
])  # fmt: skip
def test_straight_alpha_is_kept(tmp_path: Path, form: str, options: dict[str, object]) -> None:
    image = noise(channels=4)
    path = written(tmp_path / f"a.{form.lower()}", encoded(image, form, **options))
    np.testing.assert_array_equal(codes_of(path), image)


def test_avif_alpha(tmp_path: Path) -> None:
    image = np.full((32, 32, 4), (200, 100, 50, 128), np.uint8)
    path = written(tmp_path / "a.avif", encoded(image, "AVIF", quality=100))
    np.testing.assert_allclose(codes_of(path), image, atol=3)


# ---- HEIC and AVIF ----


def test_heic_of_8_and_10_bits(tmp_path: Path) -> None:
    image = np.full((64, 64, 3), (200, 100, 50), np.uint8)
    file = pillow_heif.from_pillow(Image.fromarray(image))
    file.save(tmp_path / "a.heic", quality=100)
    np.testing.assert_allclose(codes_of(tmp_path / "a.heic"), image, atol=3)
    deep = np.full((64, 64, 3), (1023, 400, 100), np.uint16)
    file = pillow_heif.from_bytes("RGB;10", (64, 64), deep.tobytes())
    file.save(tmp_path / "b.heic", quality=100)
    clip = open_clip(tmp_path / "b.heic")
    assert clip.info.encoding.bit_depth == 10
    np.testing.assert_allclose(codes_of(tmp_path / "b.heic"), deep, atol=6)


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("form", ["AVIF", "WEBP", "TIFF", "PNG", "JPEG"])
def test_orientation(tmp_path: Path, orientation: int, form: str) -> None:
    image = np.zeros((32, 48, 3), np.uint8)
    image[:16, :24] = (250, 0, 0)
    image[16:, 24:] = (0, 0, 250)
    exif = Image.Exif()
    exif[0x0112] = orientation
    options = {"lossless": True} if form == "WEBP" else {}
    path = written(tmp_path / "a", encoded(image, form, exif=exif.tobytes(), **options))
    turned = Image.fromarray(image)
    how = {2: 0, 3: 3, 4: 1, 5: 5, 6: 4, 7: 6, 8: 2}.get(orientation)
    want = np.asarray(turned if how is None else turned.transpose(Image.Transpose(how)))
    got = codes_of(path).astype(float)
    assert got.shape == want.shape
    assert np.abs(got - want).mean() < 8


def test_heic_orientation(tmp_path: Path) -> None:
    image = np.zeros((32, 64, 3), np.uint8)
    image[:, :32] = 250
    exif = Image.Exif()
    exif[0x0112] = 6  # turn by 90 degrees clockwise
    picture = Image.fromarray(image)
    pillow_heif.from_pillow(picture).save(tmp_path / "a.heic", exif=exif.tobytes(), quality=95)
    got = codes_of(tmp_path / "a.heic")
    assert got.shape == (64, 32, 3)
    assert got[:24].mean() > 200 > 50 > got[40:].mean()
