"""Stills whose codes are no sRGB, and names that no library takes: read rightly or refused."""

from __future__ import annotations

import io
import os
import struct
import sys
import zlib
from pathlib import Path

import av
import numpy as np
import pytest
from image_files import chunk, written
from PIL import Image
from stills import PATCHES, at_patches, encoded, linear_srgb, noise, patches

from itmo_video.delivery.svt_av1 import svt_as_guest
from itmo_video.errors import AlreadyHdrError, InputError
from itmo_video.source.opening import open_clip
from itmo_video.source.tags import InputOptions


@pytest.mark.parametrize("profile", [0, 3, 4, 5, 6])
def test_digital_cinema_is_not_shown_as_srgb(tmp_path: Path, profile: int) -> None:
    data = bytearray(encoded(patches(), "JPEG2000"))
    at = data.index(b"\xff\x4f\xff\x51") + 6
    data[at : at + 2] = profile.to_bytes(2, "big")
    path = tmp_path / "a.jp2"
    path.write_bytes(data)
    if profile:
        with pytest.raises(AlreadyHdrError, match="X'Y'Z'") as caught:
            open_clip(path)
        assert "--transfer srgb" in str(caught.value.remedy)
    with open_clip(path, InputOptions(transfer="srgb")) as clip:
        assert clip.info.encoding.transfer == "srgb"


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="names are always Unicode there")
@pytest.mark.parametrize("form", ["PNG", "JPEG", "TIFF"])
def test_a_name_that_is_not_utf8(tmp_path: Path, form: str) -> None:
    path = Path(os.fsdecode(os.fsencode(tmp_path) + b"/lat\xff1.png"))
    path.write_bytes(encoded(patches(), form))
    with open_clip(path) as clip:
        assert next(clip.frames()).size == (128, 16)


def test_lab_is_not_shown_as_rgb(tmp_path: Path) -> None:
    path = tmp_path / "a.tif"
    Image.frombytes("LAB", (128, 16), patches().tobytes()).save(path)
    with pytest.raises(InputError, match=r"L\*a\*b\*"):
        open_clip(path)


@pytest.mark.parametrize(("mode", "channels"), [(3, 3), (4, 4), (9, 3)])
def test_psd_of_inks_and_lab_is_refused(tmp_path: Path, mode: int, channels: int) -> None:
    head = struct.pack(">4sH6xHIIHH", b"8BPS", 1, channels, 16, 128, 8, mode)
    pixels = patches()[..., [0, 1, 2, 0][:channels]].transpose(2, 0, 1).tobytes()
    path = tmp_path / "a.psd"
    path.write_bytes(head + bytes(12) + bytes(2) + pixels)
    if mode == 3:
        with open_clip(path) as clip:
            assert (next(clip.frames()).planes[0] == patches()[..., 0]).all()
        return
    with pytest.raises(InputError, match="colours are"):
        open_clip(path)


def with_chunk(data: bytes, name: bytes, body: bytes) -> bytes:
    """A PNG with one more chunk after its header."""
    crc = struct.pack(">I", zlib.crc32(name + body))
    return data[:33] + struct.pack(">I", len(body)) + name + body + crc + data[33:]


@pytest.mark.parametrize("form", ["PNG", "RGBA", "APNG"])
def test_any_gamma_of_png_is_applied(tmp_path: Path, form: str) -> None:
    image = patches()
    if form == "RGBA":
        image = np.dstack((image, np.full(image.shape[:2], 200, np.uint8)))
    more = {"save_all": True, "append_images": [Image.new("RGB", (128, 16))]}
    data = encoded(image, "PNG", **(more if form == "APNG" else {}))
    path = tmp_path / "a.png"
    path.write_bytes(with_chunk(data, b"gAMA", struct.pack(">I", 55556)))
    got = at_patches(linear_srgb(path))
    np.testing.assert_allclose(got, (PATCHES / 255) ** 1.8, atol=1e-4)
    with open_clip(path) as clip:
        assert any("1/1.8" in notice for notice in clip.info.notices)
        assert next(clip.frames()).encoding == clip.info.encoding
    with open_clip(path, InputOptions(transfer="srgb")) as clip:
        assert clip.info.encoding.bit_depth == 8


@pytest.mark.parametrize(("chunk", "body", "words"), [
    (b"gAMA", bytes(4), "gamma"), (b"cICP", bytes([1, 13, 0, 0]), "limited range"),
    (b"cICP", bytes([1, 13, 9, 1]), "matrix"), (b"cICP", bytes([8, 13, 0, 1]), "generic film"),
    (b"cICP", bytes([77, 13, 0, 1]), "number 77"), (b"cICP", bytes([1, 99, 0, 1]), "number 99"),
    (b"cHRM", struct.pack(">8I", *[30000] * 8), "cHRM"),
])  # fmt: skip
def test_what_is_not_read_of_a_png_is_told(
    tmp_path: Path, chunk: bytes, body: bytes, words: str
) -> None:
    path = tmp_path / "a.png"
    path.write_bytes(with_chunk(encoded(patches(), "PNG"), chunk, body))
    with open_clip(path) as clip:
        assert any(words in notice for notice in clip.info.notices)


def test_xyz_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    path.write_bytes(with_chunk(encoded(patches(), "PNG"), b"cICP", bytes([10, 13, 0, 1])))
    with pytest.raises(InputError, match="XYZ"):
        open_clip(path)


def gif(
    canvas: tuple[int, int], frames: list[tuple[int, int, int, int, int]], disposal: int = 1
) -> bytes:
    """A GIF of plain frames (left, top, width, height, colour) with a palette of four colours."""
    out = b"GIF89a" + struct.pack("<HH", *canvas) + bytes([0x81, 0, 0])
    out += bytes([250, 0, 0, 0, 250, 0, 0, 0, 250, 90, 90, 90])
    for left, top, width, height, colour in frames:
        codes = [code for _ in range(width * height) for code in (4, colour)] + [5]
        bits = sum(code << 3 * n for n, code in enumerate(codes))  # a clear code before each pixel
        body = bits.to_bytes((3 * len(codes) + 7) // 8, "little")
        out += bytes([0x21, 0xF9, 4, disposal << 2, 10, 0, 0, 0, 0x2C])
        out += struct.pack("<HHHHB", left, top, width, height, 0)
        out += bytes([2, len(body)]) + body + bytes(1)
    return out + b";"


@pytest.mark.parametrize("count", [1, 2])
def test_gif_is_clear_where_no_frame_painted(tmp_path: Path, count: int) -> None:
    path = tmp_path / "a.gif"
    path.write_bytes(gif((12, 9), [(4, 3, 5, 4, 1), (0, 0, 3, 2, 2)][:count]))
    with open_clip(path) as clip:
        frames = list(clip.frames())
        assert (clip.info.frames, clip.info.encoding.has_alpha) == (count, True)
    alpha = np.zeros((9, 12), np.uint8)
    alpha[3:7, 4:9] = 255
    assert (frames[0].planes[3] == alpha).all()
    assert [int(p[4, 5]) for p in frames[0].planes] == [0, 250, 0, 255]
    if count == 2:
        alpha[:2, :3] = 255
        assert (frames[1].planes[3] == alpha).all()
        assert [int(p[1, 1]) for p in frames[1].planes] == [0, 0, 250, 255]


def test_a_whole_gif_has_no_alpha(tmp_path: Path) -> None:
    path = tmp_path / "a.gif"
    path.write_bytes(gif((6, 5), [(0, 0, 6, 5, 1), (1, 1, 2, 2, 0)]))
    with open_clip(path) as clip:
        assert not clip.info.encoding.has_alpha


@pytest.mark.parametrize("first", [(0, 0, 6, 5, 1), (1, 1, 3, 3, 1)])
def test_a_gif_frame_that_is_taken_away_leaves_it_clear(
    tmp_path: Path, first: tuple[int, int, int, int, int]
) -> None:
    path = tmp_path / "a.gif"
    path.write_bytes(gif((6, 5), [first, (1, 1, 2, 2, 2), (0, 0, 1, 1, 3)], disposal=2))
    with open_clip(path) as clip:
        frames = list(clip.frames())
        (again,) = clip.frames(2)
    for frame, (left, top, width, height) in zip(
        frames, (first[:4], (1, 1, 2, 2), (0, 0, 1, 1)), strict=True
    ):
        alpha = np.zeros((5, 6), np.uint8)
        alpha[top : top + height, left : left + width] = 255
        assert (frame.planes[3] == alpha).all()
    assert all((a == b).all() for a, b in zip(again.planes, frames[2].planes, strict=True))


def test_whole_gif_frames_that_hide_each_other_have_no_alpha(tmp_path: Path) -> None:
    path = tmp_path / "a.gif"
    path.write_bytes(gif((6, 5), [(0, 0, 6, 5, 1), (0, 0, 6, 5, 2)], disposal=2))
    with open_clip(path) as clip:
        assert not clip.info.encoding.has_alpha


def test_gain_maps_are_told(tmp_path: Path) -> None:
    xmp = b'<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf hdrgm:Version="1.0"/></x:xmpmeta>'
    data = encoded(noise(), "JPEG", xmp=xmp)
    notices = open_clip(written(tmp_path / "a.jpg", data)).info.notices
    assert any("gain map" in notice for notice in notices)


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
def test_colour_chunks_of_png(
    tmp_path: Path, chunks: tuple[tuple[bytes, bytes], ...], transfer: str, primaries: str
) -> None:
    data = encoded(noise(), "PNG")
    extra = b"".join(chunk(name, body) for name, body in chunks)
    path = written(tmp_path / "a.png", data[:33] + extra + data[33:])
    encoding = open_clip(path).info.encoding
    assert (encoding.transfer, encoding.primaries) == (transfer, primaries)


def test_pq_stills_are_refused(tmp_path: Path) -> None:
    data = encoded(noise(), "PNG")
    tag = chunk(b"cICP", bytes([9, 16, 0, 1]))
    with pytest.raises(AlreadyHdrError, match="PQ"):
        open_clip(written(tmp_path / "a.png", data[:33] + tag + data[33:]))
