"""Pixel formats: every kind's codes as planes."""

from __future__ import annotations

from pathlib import Path

import av
import numpy as np
import pytest
from source_clips import write_scene

from itmo_video.errors import AlreadyHdrError
from itmo_video.source import planes
from itmo_video.source.opening import open_clip


@pytest.mark.parametrize("form", ["rgb24", "bgr24", "rgba", "bgra", "argb", "abgr", "rgb48le",
    "rgb48be", "rgba64le", "rgba64be", "gbrp", "gbrap", "gbrp10le", "gbrp16le", "gray", "gray10le",
    "gray16le", "gray16be", "rgb0", "0bgr"])  # fmt: skip
def test_rgb_kinds_give_their_codes(form: str) -> None:
    rng = np.random.default_rng(5)
    deep = any(mark in form for mark in ("16", "10", "48", "64"))
    depth = 10 if "10" in form else 16 if deep else 8
    frame = av.VideoFrame(37, 5, form)
    dtype = np.dtype(">u2" if form.endswith("be") else "<u2" if deep else "u1")
    raws = []
    for plane in frame.planes:
        raw = np.zeros((plane.height, plane.line_size // dtype.itemsize), dtype)
        raw[:] = rng.integers(0, 2**depth, raw.shape)
        plane.update(raw.tobytes())
        raws.append(raw)
    picture = planes.read_picture(frame)
    assert picture.bit_depth == depth
    if form.startswith("gray"):
        want = [raws[0][:, :37]]
    elif form.startswith("gb"):
        want = [raws[i][:, :37] for i in (2, 0, 1, 3)[: len(raws)]]
    else:
        letters = form.removesuffix("le").removesuffix("be").rstrip("0123456789") or form
        letters = {"rgb0": "rgb0", "0bgr": "0bgr"}.get(form, letters)
        step = len(letters)
        wanted = "rgba" if "a" in letters else "rgb"
        want = [raws[0][:, letters.index(c) : 37 * step : step] for c in wanted]
    assert picture.has_alpha == (len(want) == 4)
    assert len(picture.planes) == len(want)
    for got, codes in zip(picture.planes, want, strict=True):
        np.testing.assert_array_equal(got, codes)
        assert got.dtype == (np.uint8 if depth == 8 else np.uint16)


@pytest.mark.parametrize(("form", "planar"), [
    ("nv12", "yuv420p"), ("nv21", "yuv420p"), ("nv16", "yuv422p"), ("nv24", "yuv444p"),
    ("uyvy422", "yuv422p"), ("yuyv422", "yuv422p"), ("yvyu422", "yuv422p"),
    ("p010le", "yuv420p10le"), ("p210le", "yuv422p10le"), ("yuv420p10be", "yuv420p10le"),
])  # fmt: skip
def test_ycbcr_kinds_equal_the_planar_one(form: str, planar: str) -> None:
    rng = np.random.default_rng(6)
    source = av.VideoFrame(38, 10, planar)
    deep = "10" in planar
    for plane in source.planes:
        raw = rng.integers(0, 1024 if deep else 256, (plane.height, plane.line_size // (1 + deep)))
        plane.update(raw.astype("<u2" if deep else "u1").tobytes())
    want = planes.read_picture(source)
    got = planes.read_picture(source.reformat(format=form, threads=1))  # its slices race
    assert (got.family, got.bit_depth, got.has_alpha) == ("ycbcr", want.bit_depth, False)
    for a, b in zip(got.planes, want.planes, strict=True):
        np.testing.assert_array_equal(a, b)
        assert a.flags.c_contiguous


@pytest.mark.parametrize("form", ["grayf32le", "gbrpf32le"])
def test_floats_are_hdr(form: str) -> None:
    with pytest.raises(AlreadyHdrError):
        planes.read_picture(av.VideoFrame(8, 8, form))


@pytest.mark.parametrize("form", ["monob", "monow", "rgb565le", "x2rgb10le", "vuya"])
def test_rare_kinds_are_unpacked(form: str) -> None:
    picture = planes.read_picture(av.VideoFrame(8, 8, form))
    assert all(plane.shape == (8, 8) for plane in picture.planes)


@pytest.mark.parametrize("stored", ["yuv411p", "yuv410p"])
def test_quarter_chroma_is_brought_to_full_size(tmp_path: Path, stored: str) -> None:
    clip = open_clip(write_scene(tmp_path / "a.mkv", "ffv1", 2, stored=stored))
    frame = next(clip.frames())
    assert {plane.shape for plane in frame.planes} == {(64, 96)}
    assert (frame.encoding.bit_depth, frame.encoding) == (16, clip.info.encoding)


def test_upside_down_rgb_is_turned(tmp_path: Path) -> None:
    """Uncompressed AVI is stored from the bottom row up."""
    path = write_scene(tmp_path / "a.avi", "rawvideo", 2, stored="bgr24")
    frame = next(open_clip(path).frames())
    with av.open(str(path)) as box:
        want = (
            next(box.decode(video=0)).reformat(format="gbrp", threads=1).to_ndarray(format="rgb24")
        )
    np.testing.assert_array_equal(np.stack(frame.planes, -1), want)


@pytest.mark.parametrize(("form", "bits"), [
    ("rgb555le", (5, 5, 5)), ("rgb565le", (5, 6, 5)), ("bgr555le", (5, 5, 5)),
    ("bgr565be", (5, 6, 5)), ("rgb444le", (4, 4, 4)), ("rgb555be", (5, 5, 5)),
])  # fmt: skip
def test_white_of_few_bits_is_white(form: str, bits: tuple[int, int, int]) -> None:
    frame = av.VideoFrame(16, 4, form)
    for plane in frame.planes:
        plane.update(b"\xff" * plane.buffer_size)
    assert {int(p.min()) for p in planes.read_picture(frame).planes} == {255}
    if form != "rgb565le":
        return
    frame = av.VideoFrame(32, 1, form)
    ramp = np.arange(32, dtype="<u2")
    row = np.zeros(frame.planes[0].line_size // 2, "<u2")
    row[:32] = ramp << 11 | ramp * 2 << 5 | ramp
    frame.planes[0].update(row.tobytes())
    for codes, levels, depth in zip(
        planes.read_picture(frame).planes, (ramp, ramp * 2, ramp), bits, strict=True
    ):
        np.testing.assert_array_equal(codes[0], np.rint(levels * 255 / (2**depth - 1)))
