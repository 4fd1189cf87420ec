"""Captures: cut, joined, with empty chunks, or damaged; which frames are repeats, which missing."""

from __future__ import annotations

import struct
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
from clips import write_noise

from itmo_video.source.opening import open_clip


def capture(path: Path, gop: str) -> bytes:
    with av.open(str(path), "w") as box_:
        stream = box_.add_stream("libx264", rate=25, options={"x264-params": gop})
        stream.width, stream.height, stream.pix_fmt = 96, 64, "yuv420p"
        rng = np.random.default_rng(1)
        scene = rng.integers(0, 255, (64, 400, 3), np.uint8)
        for n in range(50):
            picture = np.ascontiguousarray(scene[:, 4 * n : 4 * n + 96])
            frame = av.VideoFrame.from_ndarray(picture, "rgb24")
            frame = frame.reformat(format="yuv420p", threads=1)
            frame.pts = n
            box_.mux(stream.encode(frame))
        box_.mux(stream.encode())
    return path.read_bytes()


def test_a_capture_cut_at_an_open_group_is_no_damage(tmp_path: Path) -> None:
    data = capture(tmp_path / "a.ts", "keyint=10:min-keyint=10:bframes=3:open-gop=1:scenecut=0")
    whole = list(open_clip(tmp_path / "a.ts").frames())
    packets = [data[at : at + 188] for at in range(0, len(data), 188)]
    heads = packets[:3]
    for part in (0.25, 0.4, 0.6):
        rest = packets[int(len(packets) * part) :]
        (tmp_path / "cut.ts").write_bytes(b"".join(heads + rest))
        clip = open_clip(tmp_path / "cut.ts")
        found = list(clip.frames())
        assert [f.index for f in found] == list(range(clip.info.frames))
        assert not any(f.is_damaged for f in found[1:-1])
        assert any("starts in the middle" in notice for notice in clip.info.notices)
        np.testing.assert_array_equal(found[-1].planes[0], whole[-1].planes[0])
        again = next(iter(clip.frames(3)))
        np.testing.assert_array_equal(again.planes[0], found[3].planes[0])


def test_joined_captures_are_continuous(tmp_path: Path) -> None:
    first = capture(tmp_path / "a.ts", "keyint=10:scenecut=0")
    with av.open(str(tmp_path / "a.ts")) as source, av.open(str(tmp_path / "b.ts"), "w") as later:
        stream = later.add_stream_from_template(source.streams.video[0])
        for packet in source.demux(source.streams.video[0]):
            if packet.size:
                assert packet.pts is not None
                assert packet.dts is not None
                packet.pts += 90000 * 40000
                packet.dts += 90000 * 40000
                packet.stream = stream
                later.mux(packet)
    second = (tmp_path / "b.ts").read_bytes()
    for order in ((first, second), (second, first)):
        (tmp_path / "joined.ts").write_bytes(b"".join(order))
        clip = open_clip(tmp_path / "joined.ts")
        assert clip.info.frames == 100
        assert clip.info.duration_s == 4
        frames = list(clip.frames())
        assert [f.time_s for f in frames] == [Fraction(n, 25) for n in range(100)]
        np.testing.assert_array_equal(frames[10].planes[0], frames[60].planes[0])
        assert any("jump" in notice for notice in clip.info.notices)


def with_empty_chunks(data: bytes, which: set[int]) -> bytes:
    """An AVI with these frames' chunks made empty in place, the rest of each a JUNK chunk."""
    out, at, number = bytearray(data), data.index(b"movi") + 4, 0
    while data[at : at + 4] in (b"00dc", b"JUNK", b"ix00"):
        name, size = struct.unpack_from("<4sI", data, at)
        if name == b"00dc":
            if number in which:
                struct.pack_into("<I4sI", out, at + 4, 0, b"JUNK", size + size % 2 - 8)
            number += 1
        at += 8 + size + size % 2
    entries = data.index(b"idx1") + 8
    for n in which:
        struct.pack_into("<I", out, entries + 16 * n + 12, 0)
    index = data.find(b"ix00")
    for n in which if index >= 0 else ():
        struct.pack_into("<I", out, index + 32 + 8 * n + 4, 0)
    return bytes(out)


@pytest.mark.parametrize("which", [{3, 4, 8}, {11}, {1, 3, 5, 7, 9, 11}])
def test_empty_chunks_of_avi_are_repeats(tmp_path: Path, which: set[int]) -> None:
    path = tmp_path / "a.avi"
    with av.open(str(path), "w") as film:
        stream = film.add_stream("mjpeg", rate=25)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuvj420p"
        for n in range(12):
            frame = av.VideoFrame(64, 48, "yuvj420p")
            for plane, value in zip(frame.planes, (20 * n, 128, 128), strict=True):
                plane.update(bytes([value]) * plane.buffer_size)
            frame.pts = n
            film.mux(stream.encode(frame))
        film.mux(stream.encode())
    path.write_bytes(with_empty_chunks(path.read_bytes(), which))
    clip = open_clip(path)
    assert (clip.info.frames, clip.info.frames_declared) == (12, 12)
    shown = [max(m for m in range(n + 1) if m not in which) for n in range(12)]
    for start in range(12):
        found = list(clip.frames(start))
        assert [f.index for f in found] == list(range(start, 12))
        for got in found:
            assert abs(int(got.planes[0][0, 0]) - 20 * shown[got.index]) <= 2


@pytest.mark.parametrize(("start", "size"), [(0.3, 7000), (0.5, 40000), (0.7, 12000)])
def test_frames_that_a_damaged_wmv_lost_are_missed(tmp_path: Path, start: float, size: int) -> None:
    path = write_noise(tmp_path / "a.wmv", "wmv2", 40, seed=5)
    with open_clip(path) as clip:
        assert (clip.info.frames, clip.info.frames_declared) == (40, 40)
    data = bytearray(path.read_bytes())
    at = int(start * len(data))
    data[at : at + size] = bytes(size)
    path.write_bytes(data)
    with open_clip(path) as clip:
        assert clip.info.frames < 40 or any(f.is_damaged for f in clip.frames())
        assert clip.info.frames_declared == 40
        if clip.info.frames < 40:
            missing = f"damaged: {40 - clip.info.frames} frame"
            assert any(missing in notice for notice in clip.info.notices)
