"""The law on damaged clips: a short run of damaged_decodes.py, and files that once differed."""

from __future__ import annotations

import random
import sys
from fractions import Fraction
from pathlib import Path

import av
import pytest
from clips import SHARED, moving_scene

sys.path.insert(0, str(Path(__file__).parent))

from codec_clips import CODECS, make_clip
from damaged_decodes import frames, of_codec, trial

from itmo_video.source import flash_blocks
from itmo_video.source.cineform_bands import is_whole
from itmo_video.source.deinterlace import deinterlaced
from itmo_video.source.ffv1_slices import slices_of
from itmo_video.source.opening import open_clip

ONCE = sorted((SHARED / "data/fault_files/law").glob("*"))
SOUND = SHARED / "data/fault_files/theora.ogv"


@pytest.mark.parametrize("codec", ["h264", "h264fields", "hevc", "mpeg2ts", "ffv1", "vp8"])
def test_damaged_clips_decode_alike(codec: str) -> None:
    told = of_codec(codec, trials=3, seed=1000)
    assert told["differ"] == 0


@pytest.mark.skipif(not ONCE, reason="needs ../shared")
@pytest.mark.parametrize("path", [*ONCE, SOUND], ids=lambda path: path.name)
def test_files_that_once_differed(path: Path) -> None:
    assert trial(path, random.Random(77)) == []


def test_what_is_beyond_a_gap_is_no_neighbour_of_a_deinterlaced_frame() -> None:
    """Found by damaged_decodes.py (h264fields, seed 2200, 64x48): it depended on the start."""

    def pictures(*indices: int) -> dict[int, bytes]:
        codes = dict(enumerate(moving_scene(12, width=64, height=48)))
        given = (
            (n, av.VideoFrame.from_ndarray(codes[n], "rgb24").reformat(format="yuv420p"), False)
            for n in indices
        )
        found = deinterlaced(given, True, Fraction(1, 24), lambda frame: True)
        return {n: frame.to_ndarray().tobytes() for n, frame, _ in found}

    whole = pictures(0, 1, 2, 8, 9, 10)
    assert list(whole) == [0, 1, 2, 8, 9, 10]
    assert pictures(8, 9, 10) == {n: whole[n] for n in (8, 9, 10)}
    assert pictures(0, 1, 2) == {n: whole[n] for n in (0, 1, 2)}
    assert pictures(0, 1, 2, 3)[2] != whole[2], "the frame behind it is a neighbour"


@pytest.mark.parametrize("codec", ["h264", "h264mkv", "h264refresh", "hevcopen", "mpeg2ts", "av1"])
def test_sound_clips_are_whole_from_anywhere(codec: str, tmp_path: Path) -> None:
    path = make_clip(codec, tmp_path)
    whole = frames(path)
    assert list(whole) == list(range(60))
    for start in (1, 11, 12, 13, 30, 59):
        assert frames(path, start) == {n: check for n, check in whole.items() if n >= start}
    with open_clip(path) as clip:
        for start in (0, 13, 40):
            assert not any(frame.is_damaged for frame in clip.frames(start)), "sound frames named"


def test_damage_that_the_decoder_conceals_without_a_word_is_named(tmp_path: Path) -> None:
    """HEVC's decoder flags no frame: what fails when it is strict, and what follows, is named."""
    path = make_clip("hevc", tmp_path)
    data = bytearray(path.read_bytes())
    for at in range(len(data) // 2, len(data) // 2 + 400, 7):
        data[at] ^= 0x55
    path.write_bytes(data)
    with open_clip(path) as clip:
        found = {frame.index: frame.is_damaged for frame in clip.frames()}
    assert any(found.values()) or len(found) < 60
    assert not all(found.values())


def test_a_slice_of_ffv1_whose_check_sum_is_wrong_is_damage(tmp_path: Path) -> None:
    """FFmpeg's decoder says so in its log only, and shows what it makes of it."""
    path = tmp_path / "a.mkv"
    options = {"level": "3", "slicecrc": "1", "slices": "4", "g": "12"}
    with av.open(str(path), "w") as box:
        stream = box.add_stream("ffv1", rate=Fraction(24), options=options)
        stream.width, stream.height, stream.pix_fmt = 96, 64, "yuv420p"
        for n, codes in enumerate(moving_scene(30, width=96, height=64)):
            frame = av.VideoFrame.from_ndarray(codes, "rgb24").reformat(format="yuv420p")
            frame.pts, frame.time_base = n, Fraction(1, 24)
            box.mux(stream.encode(frame))
        box.mux(stream.encode())
    with open_clip(path) as clip:
        assert not any(frame.is_damaged for frame in clip.frames())
    with av.open(str(path)) as box:
        packets = [bytes(packet) for packet in box.demux(video=0) if packet.size]
    assert all(len(slices_of(packet) or ()) == 4 for packet in packets)
    data = bytearray(path.read_bytes())
    data[data.index(packets[15]) + len(packets[15]) // 2] ^= 1
    path.write_bytes(data)
    with open_clip(path) as clip:
        damaged = [frame.index for frame in clip.frames() if frame.is_damaged]
        assert damaged[0] == 15
        again = [frame.index for frame in clip.frames(16) if frame.is_damaged]
    assert again == damaged[1:]


@pytest.mark.parametrize("pixels", ["yuv422p10le", "gbrp12le", "gbrap12le"])
def test_a_cineform_packet_that_is_not_whole_is_left_out_alone(
    pixels: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """FFmpeg's decoder shows memory that was never written where sizes of bands are damaged."""
    monkeypatch.setitem(CODECS, "cfhd", ("cfhd", "mov", pixels, {}))
    path = make_clip("cfhd", tmp_path, frames=30, size=(96, 64))
    with av.open(str(path)) as box:
        packets = [bytes(packet) for packet in box.demux(video=0) if packet.size]
    assert all(map(is_whole, packets))
    whole = frames(path)
    tags = [tag.to_bytes(2, "big") for tag in (27, 28, 41, 42, 48, 49, 50, 51, 56, 62, 55)]
    aligned = range(0, len(packets[26]), 4)
    words = [next(at for at in aligned if packets[26][at : at + 2] == tag) for tag in tags]
    for byte in (*(at + 1 for at in words), *(at + 3 for at in words[:-1])):
        assert not is_whole(packets[26][:byte] + b"\x7a" + packets[26][byte + 1 :]), byte
    assert not is_whole(packets[26][: len(packets[26]) // 2])
    data = bytearray(path.read_bytes())
    for number, at in ((0, words[3]), (26, words[-2])):
        data[data.index(packets[number]) + at + 1] ^= 0x7A
    path.write_bytes(data)
    rest = {n: check for n, check in whole.items() if n not in (0, 26)}
    assert frames(path) == rest
    assert frames(path, 25) == {n: check for n, check in rest.items() if n >= 25}
    with open_clip(path) as clip:
        assert not any(frame.is_damaged for frame in clip.frames()), "what follows is whole"


def test_a_broken_block_of_flash_screen_video_is_left_out_and_what_follows_named(
    tmp_path: Path,
) -> None:
    """FFmpeg's decoder goes on with memory that was never written (seed 2276, 64x48)."""
    path = make_clip("flashsv", tmp_path, frames=30, size=(96, 64))
    with av.open(str(path)) as box:
        packets = [bytes(packet) for packet in box.demux(video=0) if packet.size]
    assert all(map(flash_blocks.is_whole, packets))
    assert not flash_blocks.is_whole(packets[25][:-1])
    assert not flash_blocks.is_whole(packets[25] + b"\0")
    whole = frames(path)
    data = bytearray(path.read_bytes())
    data[data.index(packets[25]) + len(packets[25]) // 2] ^= 0x55
    path.write_bytes(data)
    for start in (0, 24, 25, 27):
        rest = {n: check for n, check in whole.items() if n >= start and n != 25}
        assert frames(path, start) == rest
    with open_clip(path) as clip:
        assert [f.index for f in clip.frames() if f.is_damaged] == [26, 27, 28, 29]


@pytest.mark.parametrize("fault", ["a FRAME line", "a cut"])
def test_a_y4m_that_breaks_off_is_cut_short(tmp_path: Path, fault: str) -> None:
    body = b"".join(b"FRAME\n" + bytes([n]) * 96 for n in range(16, 36))
    data = bytearray(b"YUV4MPEG2 W8 H8 F25:1 Ip A1:1 C420jpeg\n" + body)
    path = tmp_path / "a.y4m"
    path.write_bytes(data)
    with open_clip(path) as clip:
        assert not any("truncated" in notice for notice in clip.info.notices)
        assert sum(1 for _ in clip.frames()) == 20
    if fault == "a cut":
        del data[-10:]
    else:
        data[len(data) - 5 * 102] = ord("f")
    path.write_bytes(data)
    missing = "1 frame is missing" if fault == "a cut" else "5 frames are missing"
    with open_clip(path) as clip:
        assert any(missing in notice for notice in clip.info.notices), clip.info.notices


def test_a_codec_tag_that_is_not_ascii(tmp_path: Path) -> None:
    path = make_clip("mpeg4", tmp_path, frames=3, size=(64, 48))
    data = path.read_bytes()
    assert data.count(b"mp4v") == 1
    path.write_bytes(data.replace(b"mp4v", b"mp\x8fv"))
    with pytest.raises(UnicodeDecodeError), av.open(str(path)) as box:
        assert box.streams.video[0].codec_context.codec_tag
    with open_clip(path) as clip:
        assert sum(1 for _ in clip.frames()) == 3
