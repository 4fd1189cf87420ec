"""Which stream of a file, and which size: films made here, and containers' boxes byte by byte."""

from __future__ import annotations

import struct
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
from clips import film_encoding
from oracles import to_rgb_code
from source_clips import write_streams

from itmo_video.errors import InputError, UsageError
from itmo_video.model import Code, Encoding, Float32, Frame
from itmo_video.source import cropping, iso_boxes, matroska
from itmo_video.source.opening import open_clip
from itmo_video.source.tags import InputOptions
from itmo_video.source.track_facts import DolbyVision, TrackFacts


def test_the_stream_flagged_as_default_is_the_film(tmp_path: Path) -> None:
    path = write_streams(tmp_path / "a.mkv", [(64, 48), (96, 64)], default=1)
    info = open_clip(path).info
    assert info.display_size == (96, 64)
    assert any("0 (64x48)" in notice and "--stream" in notice for notice in info.notices)
    assert open_clip(path, InputOptions(stream=0)).info.display_size == (64, 48)
    frames = list(open_clip(path, InputOptions(stream=0)).frames(5))
    assert [f.index for f in frames] == list(range(5, 12))
    assert frames[0].size == (64, 48)


def test_without_flags_the_first_is_the_film(tmp_path: Path) -> None:
    path = write_streams(tmp_path / "a.ts", [(64, 48), (96, 64)])
    assert open_clip(path).info.display_size == (64, 48)


def test_a_number_that_is_no_video_is_wrong_usage(tmp_path: Path) -> None:
    path = write_streams(tmp_path / "a.mkv", [(64, 48)])
    with pytest.raises(UsageError, match="stream 3"):
        open_clip(path, InputOptions(stream=3))


def test_cover_art_is_no_film(tmp_path: Path) -> None:
    with av.open(str(tmp_path / "a.m4a"), "w", format="mp4") as box:
        sound = box.add_stream("aac", rate=48000)
        cover = box.add_stream("mjpeg", rate=1)
        cover.width, cover.height, cover.pix_fmt = 32, 32, "yuvj420p"
        cover.disposition = av.stream.Disposition.attached_pic
        frame = av.VideoFrame(32, 32, "yuvj420p")
        frame.pts = 0
        box.mux(cover.encode(frame))
        tone = av.AudioFrame.from_ndarray(np.zeros((1, 4800), np.float32), "fltp", "mono")
        tone.sample_rate, tone.pts = 48000, 0
        box.mux(sound.encode(tone))
        box.mux(sound.encode())
    with pytest.raises(InputError, match="contains no video"):
        open_clip(tmp_path / "a.m4a")


def box(name: bytes, body: bytes) -> bytes:
    return struct.pack(">I", 8 + len(body)) + name + body


def movie(entry: bytes, *children: bytes, size: tuple[int, int] = (720, 480)) -> bytes:
    """The boxes of an MP4 file of one video track, without pictures."""
    visual = bytes(24) + struct.pack(">HH", *size) + bytes(50)
    stsd = box(b"stsd", bytes(4) + struct.pack(">I", 1) + box(entry, visual + b"".join(children)))
    minf = box(b"minf", box(b"vmhd", bytes(12)) + box(b"stbl", stsd))
    tkhd = box(b"tkhd", bytes(12) + struct.pack(">I", 7) + bytes(68))
    trak = box(b"trak", tkhd + box(b"mdia", minf))
    return box(b"ftyp", b"isom" + bytes(4)) + box(b"mdat", bytes(99)) + box(b"moov", trak)


def test_clean_apertures_are_read(tmp_path: Path) -> None:
    clap = box(b"clap", struct.pack(">IIIIiIiI", 704, 1, 480, 1, -8, 2, 0, 1))
    path = tmp_path / "a.mov"
    path.write_bytes(movie(b"apcn", clap))
    assert iso_boxes.video_tracks(path) == {7: TrackFacts("apcn", (4, 0, 12, 0))}
    path.write_bytes(movie(b"apcn", box(b"clap", struct.pack(">IIIIiIiI", 9, 0, 9, 0, 0, 0, 0, 0))))
    assert iso_boxes.video_tracks(path)[7].crop is None


def element(kind: int, body: bytes) -> bytes:
    size = struct.pack(">Q", len(body) | 1 << 56)
    return kind.to_bytes((kind.bit_length() + 7) // 8, "big") + size


def ebml(kind: int, *bodies: bytes) -> bytes:
    body = b"".join(bodies)
    return element(kind, body) + body


def mkv(*parts: bytes) -> bytes:
    entry = ebml(0xAE, ebml(0x83, b"\1"), ebml(0x86, b"V_MPEG4/ISO/AVC"), *parts)
    audio = ebml(0xAE, ebml(0x83, b"\2"))
    return ebml(0x1A45DFA3, b"\0") + ebml(0x18538067, ebml(0x1654AE6B, audio, entry))


def test_matroska_crops_and_dolby_vision_are_read(tmp_path: Path) -> None:
    path = tmp_path / "a.mkv"
    record = bytes([1, 0, 5 << 1, 0, 0]) + bytes(19)
    mapping = ebml(0x41E4, ebml(0x41E7, b"dvcC"), ebml(0x41ED, record))
    video = ebml(0xE0, ebml(0x54BB, b"\x28"), ebml(0x54AA, b"\x28"))
    path.write_bytes(mkv(video, mapping))
    (track,) = matroska.video_tracks(path)
    assert track == TrackFacts("V_MPEG4/ISO/AVC", (0, 40, 0, 40), DolbyVision(5, 0))


@pytest.mark.parametrize("make", [movie(b"avc1"), mkv(ebml(0xE0, b""))])
def test_damaged_boxes_say_nothing(tmp_path: Path, make: bytes) -> None:
    rng = np.random.default_rng(0)
    path = tmp_path / "a"
    for _ in range(300):
        data = bytearray(make)
        for at in rng.integers(0, len(data), 6):
            data[at] = rng.integers(0, 256)
        path.write_bytes(bytes(data[: rng.integers(1, len(data))]))
        iso_boxes.video_tracks(path)
        matroska.video_tracks(path)


@pytest.mark.parametrize("crop", [(0, 40, 0, 40), (4, 2, 6, 8), (1, 0, 0, 0), (3, 5, 2, 1)])
def test_cropping_keeps_chroma_where_it_is(crop: tuple[int, int, int, int]) -> None:
    rng = np.random.default_rng(2)
    stored = (
        rng.integers(16, 235, (96, 64), np.uint8), rng.integers(90, 160, (48, 32), np.uint8),
        rng.integers(90, 160, (48, 32), np.uint8),
    )  # fmt: skip
    encoding = film_encoding()
    want = rgb_of(stored, encoding)[crop[1] : 96 - crop[3], crop[0] : 64 - crop[2]]
    got = rgb_of(*cropping.cropped(stored, encoding, crop))
    assert got.shape == want.shape
    inner = (slice(2, -2), slice(2, -2))  # chroma at a cut edge has no neighbour beyond it
    np.testing.assert_allclose(got[inner], want[inner], atol=2e-4)


def rgb_of(stored: tuple[Code, ...], encoding: Encoding) -> Float32:
    """The picture (H, W, 3), R'G'B' from 0 to 1, of planes as stored."""
    return np.dstack(to_rgb_code(Frame(0, Fraction(0), stored, encoding)))
