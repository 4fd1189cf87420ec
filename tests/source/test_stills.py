"""Stills: pixels, depth, alpha, orientation, animations and damage of every format that is read."""

from __future__ import annotations

import io
import struct
import zlib
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pillow_heif
import pytest
from PIL import Image
from stills import encoded, linear_srgb, noise

from itmo_video.delivery.svt_av1 import svt_as_guest
from itmo_video.errors import AlreadyHdrError, InputError
from itmo_video.source import still_formats
from itmo_video.source.opening import open_clip
from itmo_video.source.tags import InputOptions

tifffile = pytest.importorskip("tifffile")


def codes(path: Path) -> np.ndarray:
    """A still's codes (H, W, channels)."""
    with open_clip(path) as clip:
        (frame,) = clip.frames()
    return np.dstack(frame.planes)


def written(path: Path, data: bytes) -> Path:
    path.write_bytes(data)
    return path


# ---- TIFF: tiles, compressions, depths ----


@pytest.mark.parametrize("options", [
    {}, {"tile": (16, 16)}, {"tile": (32, 16), "compression": "zlib", "predictor": True},
    {"compression": "zlib"}, {"planarconfig": "separate", "tile": (16, 16)}, {"bigtiff": True},
    {"byteorder": ">"},
])  # fmt: skip
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_tiff_layouts_are_exact(tmp_path: Path, options: dict[str, object], dtype: type) -> None:
    image = np.random.default_rng(3).integers(0, np.iinfo(dtype).max, (48, 64, 3), dtype)
    stored = np.moveaxis(image, -1, 0) if "planarconfig" in options else image
    path = tmp_path / "a.tif"
    tifffile.imwrite(path, stored, photometric="rgb", **options)
    np.testing.assert_array_equal(codes(path), image)


@pytest.mark.parametrize("compression", ["tiff_lzw", "tiff_adobe_deflate", "packbits"])
def test_tiff_compressions_are_exact(tmp_path: Path, compression: str) -> None:
    image = noise()
    path = written(tmp_path / "a.tif", encoded(image, "TIFF", compression=compression))
    np.testing.assert_array_equal(codes(path), image)


def test_jpeg_in_tiff(tmp_path: Path) -> None:
    image = np.full((64, 64, 3), (200, 80, 40), np.uint8)
    path = written(tmp_path / "a.tif", encoded(image, "TIFF", compression="jpeg"))
    np.testing.assert_allclose(codes(path), image, atol=3)


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
        got = codes(path).astype(float)
        got *= top / (65535 if got.max() > top else top)
        np.testing.assert_allclose(got, straight, atol=1.5)
    clear = np.zeros((4, 4, 4), dtype)
    tifffile.imwrite(path, clear, photometric="rgb", extrasamples=["assocalpha"])
    assert not codes(path).any()


@pytest.mark.parametrize(("form", "options"), [
    ("PNG", {}), ("WEBP", {"lossless": True, "exact": True}), ("TIFF", {}), ("JPEG2000", {}),
])  # fmt: skip
def test_straight_alpha_is_kept(tmp_path: Path, form: str, options: dict[str, object]) -> None:
    image = noise(channels=4)
    path = written(tmp_path / f"a.{form.lower()}", encoded(image, form, **options))
    np.testing.assert_array_equal(codes(path), image)


def test_avif_alpha(tmp_path: Path) -> None:
    image = np.full((32, 32, 4), (200, 100, 50, 128), np.uint8)
    path = written(tmp_path / "a.avif", encoded(image, "AVIF", quality=100))
    np.testing.assert_allclose(codes(path), image, atol=3)


# ---- HEIC and AVIF ----


def test_heic_of_8_and_10_bits(tmp_path: Path) -> None:
    image = np.full((64, 64, 3), (200, 100, 50), np.uint8)
    file = pillow_heif.from_pillow(Image.fromarray(image))
    file.save(tmp_path / "a.heic", quality=100)
    np.testing.assert_allclose(codes(tmp_path / "a.heic"), image, atol=3)
    deep = np.full((64, 64, 3), (1023, 400, 100), np.uint16)
    file = pillow_heif.from_bytes("RGB;10", (64, 64), deep.tobytes())
    file.save(tmp_path / "b.heic", quality=100)
    clip = open_clip(tmp_path / "b.heic")
    assert clip.info.encoding.bit_depth == 10
    np.testing.assert_allclose(codes(tmp_path / "b.heic"), deep, atol=6)


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
    got = codes(path).astype(float)
    assert got.shape == want.shape
    assert np.abs(got - want).mean() < 8


def test_heic_orientation(tmp_path: Path) -> None:
    image = np.zeros((32, 64, 3), np.uint8)
    image[:, :32] = 250
    exif = Image.Exif()
    exif[0x0112] = 6  # turn by 90 degrees clockwise
    picture = Image.fromarray(image)
    pillow_heif.from_pillow(picture).save(tmp_path / "a.heic", exif=exif.tobytes(), quality=95)
    got = codes(tmp_path / "a.heic")
    assert got.shape == (64, 32, 3)
    assert got[:24].mean() > 200 > 50 > got[40:].mean()


# ---- animations ----

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


# ---- damage ----

FORMS = {
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
    whole = codes(path)
    cut = tmp_path / f"cut.{name}"
    for part in range(1, 24):
        cut.write_bytes(data[: len(data) * part // 24])
        try:
            got = codes(cut)
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


def test_cut_stills_are_gaps_of_a_sequence(tmp_path: Path) -> None:
    for n in range(4):
        data = encoded(noise(seed=n), "JPEG")
        written(tmp_path / f"s.{n:04d}.jpg", data[: len(data) // 2] if n == 2 else data)
    clip = open_clip(tmp_path / "s.%04d.jpg")
    assert [frame.index for frame in clip.frames()] == [0, 1, 3]
    assert "s.0002.jpg" in clip.faults[2]


def test_png_check_sums_are_checked(tmp_path: Path) -> None:
    data = bytearray(encoded(noise(), "PNG"))
    data[data.find(b"IDAT") + 40] ^= 1
    with pytest.raises(InputError, match="IDAT at byte"):
        open_clip(written(tmp_path / "a.png", bytes(data)))


# ---- bounds ----


def test_sizes_are_read_before_anything_is_decoded() -> None:
    image = Image.fromarray(noise(31, 45))
    for form, kind in (
        ("PNG", "png"), ("WEBP", "webp"), ("GIF", "gif"), ("JPEG2000", "jpeg2000"), ("QOI", "qoi"),
    ):  # fmt: skip
        for options in ({}, {"lossless": True}) if form == "WEBP" else ({},):
            data = io.BytesIO()
            image.save(data, form, **options)
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
    def chunk(name: bytes, body: bytes) -> bytes:
        crc = zlib.crc32(name + body)
        return struct.pack(">I", len(body)) + name + body + struct.pack(">I", crc)

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


def test_gain_maps_are_told(tmp_path: Path) -> None:
    xmp = b'<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf hdrgm:Version="1.0"/></x:xmpmeta>'
    data = encoded(noise(), "JPEG", xmp=xmp)
    notices = open_clip(written(tmp_path / "a.jpg", data)).info.notices
    assert any("gain map" in notice for notice in notices)


# ---- sequences ----


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


def test_avif_of_10_bits_keeps_them_and_its_range(tmp_path: Path) -> None:
    """The encoder writes the limited range, in which 940 is white."""
    data = io.BytesIO()
    with av.open(data, "w", format="avif") as box:
        stream = box.add_stream("libsvtav1", rate=1, options={"crf": "5"})
        stream.width, stream.height, stream.pix_fmt = 64, 64, "yuv420p10le"
        with svt_as_guest():
            stream.codec_context.open()
        frame = av.VideoFrame(64, 64, "yuv420p10le")
        for plane, code in zip(frame.planes, (940, 512, 512), strict=True):
            plane.update(np.full(plane.buffer_size // 2, code, "<u2").tobytes())
        frame.pts = 0
        box.mux(stream.encode(frame))
        box.mux(stream.encode(None))
    path = written(tmp_path / "a.avif", data.getvalue())
    encoding = open_clip(path).info.encoding
    assert (encoding.bit_depth, encoding.range, encoding.transfer) == (10, "limited", "srgb")
    np.testing.assert_allclose(linear_srgb(path), 1, atol=0.005)


@pytest.mark.parametrize(("chunks", "transfer", "primaries"), [
    (((b"cICP", bytes([12, 13, 0, 1])),), "srgb", "p3d65"),
    (((b"gAMA", struct.pack(">I", 100000)),), "linear", "rec709"),
    (((b"gAMA", struct.pack(">I", 45455)),), "gamma22", "rec709"),
    (((b"gAMA", struct.pack(">I", 45455)), (b"sRGB", b"\0")), "srgb", "rec709"),
])  # fmt: skip
def test_colour_chunks_of_png(tmp_path: Path, chunks, transfer: str, primaries: str) -> None:
    data = encoded(noise(), "PNG")
    extra = b"".join(
        struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))
        for name, body in chunks
    )
    path = written(tmp_path / "a.png", data[:33] + extra + data[33:])
    encoding = open_clip(path).info.encoding
    assert (encoding.transfer, encoding.primaries) == (transfer, primaries)


def test_pq_stills_are_refused(tmp_path: Path) -> None:
    data = encoded(noise(), "PNG")
    body = bytes([9, 16, 0, 1])
    chunk = struct.pack(">I", 4) + b"cICP" + body + struct.pack(">I", zlib.crc32(b"cICP" + body))
    with pytest.raises(AlreadyHdrError, match="PQ"):
        open_clip(written(tmp_path / "a.png", data[:33] + chunk + data[33:]))


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
