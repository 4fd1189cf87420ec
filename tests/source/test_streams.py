"""Which stream, which size, which times: films made here, and containers' boxes byte by byte."""

from __future__ import annotations

import struct
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
from clips import write_noise
from oracles import to_rgb_code

from itmo_video.errors import AlreadyHdrError, InputError, UsageError
from itmo_video.model import Encoding
from itmo_video.source import cropping, hidden_hdr, iso_boxes, matroska, planes
from itmo_video.source.opening import open_clip
from itmo_video.source.tags import InputOptions
from itmo_video.source.track_facts import DolbyVision, TrackFacts


def write_film(path: Path, sizes: list[tuple[int, int]], default: int | None = None, **options):
    """A film of several video streams, one size each, 12 frames at 25 a second."""
    with av.open(str(path), "w", **options) as box:
        streams = []
        for size in sizes:
            stream = box.add_stream("mpeg4", rate=25)
            stream.width, stream.height, stream.pix_fmt = *size, "yuv420p"
            streams.append(stream)
        for number, stream in enumerate(streams):
            if default is not None:
                stream.disposition = av.stream.Disposition(int(number == default))
        for n in range(12):
            for stream in streams:
                frame = av.VideoFrame(stream.width, stream.height, "yuv420p")
                for plane, value in zip(frame.planes, (40 + 10 * n, 128, 128), strict=True):
                    plane.update(bytes([value]) * plane.buffer_size)
                frame.pts = n
                box.mux(stream.encode(frame))
        for stream in streams:
            box.mux(stream.encode())
    return path


# ---- which stream ----


def test_the_stream_flagged_as_default_is_the_film(tmp_path: Path) -> None:
    path = write_film(tmp_path / "a.mkv", [(64, 48), (96, 64)], default=1)
    info = open_clip(path).info
    assert info.display_size == (96, 64)
    assert any("0 (64x48)" in notice and "--stream" in notice for notice in info.notices)
    assert open_clip(path, InputOptions(stream=0)).info.display_size == (64, 48)
    frames = list(open_clip(path, InputOptions(stream=0)).frames(5))
    assert [f.index for f in frames] == list(range(5, 12))
    assert frames[0].size == (64, 48)


def test_without_flags_the_first_is_the_film(tmp_path: Path) -> None:
    path = write_film(tmp_path / "a.ts", [(64, 48), (96, 64)])
    assert open_clip(path).info.display_size == (64, 48)


def test_a_number_that_is_no_video_is_wrong_usage(tmp_path: Path) -> None:
    path = write_film(tmp_path / "a.mkv", [(64, 48)])
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


# ---- which size ----


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
    encoding = Encoding("ycbcr", 8, "bt709", "limited", "bt1886", "rec709", "left")
    want = rgb_of(stored, encoding)[crop[1] : 96 - crop[3], crop[0] : 64 - crop[2]]
    got = rgb_of(*cropping.cropped(stored, encoding, crop))
    assert got.shape == want.shape
    inner = (slice(2, -2), slice(2, -2))  # chroma at a cut edge has no neighbour beyond it
    np.testing.assert_allclose(got[inner], want[inner], atol=2e-4)


def rgb_of(stored, encoding: Encoding) -> np.ndarray:
    from itmo_video.model import Frame

    return np.dstack(to_rgb_code(Frame(0, Fraction(0), stored, encoding)))


# ---- HDR that hides ----


class NoSideData:
    side_data: tuple[()] = ()


@pytest.mark.parametrize(("track", "transfer", "is_hdr"), [
    (TrackFacts("dvh1", None, DolbyVision(5, 0)), 2, True),
    (TrackFacts("dav1", None, DolbyVision(10, 0)), 2, True),
    (TrackFacts("dvhe"), 2, True),
    (TrackFacts("hvc1", None, DolbyVision(8, 1)), 2, True),
    (TrackFacts("hvc1", None, DolbyVision(8, 2)), 1, False),  # its base layer is SDR
    (TrackFacts("hvc1", None, DolbyVision(8, 1)), 16, False),  # the tag says so already
    (TrackFacts("hvc1"), 1, False), (TrackFacts("avc1"), 2, False),
])  # fmt: skip
def test_dolby_vision(track: TrackFacts, transfer: int, is_hdr: bool) -> None:
    assert (hidden_hdr.dolby_vision_words(track, NoSideData(), transfer) is not None) == is_hdr


@pytest.mark.parametrize(("tags", "is_log"), [
    ({"com.sony.gamma": "S-Log3"}, True), ({"com.panasonic.Semi-Pro.gamma": "V-Log"}, True),
    ({"picture_profile": "D-Log M"}, True), ({"com.apple.log": "Apple Log"}, True),
    ({"comment": "a log of the trip, in V-Log"}, False), ({"gamma": "Rec.709"}, False),
    ({"catalog": "a vlog of mine"}, True), ({"title": "vlog"}, False),
])  # fmt: skip
def test_camera_log_by_tags(tmp_path: Path, tags: dict[str, str], is_log: bool) -> None:
    path = tmp_path / "a.mp4"
    path.write_bytes(b"nothing")
    assert (hidden_hdr.log_words(path, [tags]) is not None) == is_log


def test_camera_log_by_xml_is_refused(tmp_path: Path) -> None:
    path = write_film(tmp_path / "a.mp4", [(64, 48)])
    xml = b'<Item name="CaptureGammaEquation" value="s-log3-cine"/>'
    path.write_bytes(path.read_bytes() + box(b"free", xml))
    with pytest.raises(AlreadyHdrError, match="s-log3"):
        open_clip(path)
    assert open_clip(path, InputOptions(transfer="bt1886")).info.frames == 12


# ---- codes ----


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
    for plane, levels, depth in zip(
        planes.read_picture(frame).planes, (ramp, ramp * 2, ramp), bits, strict=True
    ):
        np.testing.assert_array_equal(plane[0], np.rint(levels * 255 / (2**depth - 1)))


def test_codes_outside_the_tagged_range_are_told(tmp_path: Path) -> None:
    path = tmp_path / "a.mkv"
    with av.open(str(path), "w") as film:
        stream = film.add_stream("ffv1", rate=25)
        stream.width, stream.height, stream.pix_fmt = 64, 10, "yuv420p"
        frame = av.VideoFrame(64, 10, "yuv420p")
        luma = np.full((10, frame.planes[0].line_size), 100, np.uint8)
        luma[0] = 250
        frame.planes[0].update(luma.tobytes())
        for plane in frame.planes[1:]:
            plane.update(bytes([128]) * plane.buffer_size)
        frame.color_range, frame.pts = 1, 0
        film.mux(stream.encode(frame))
        film.mux(stream.encode())
    notices = open_clip(path).info.notices
    assert any("10.0 % of the first frame's codes" in notice for notice in notices)


@pytest.mark.parametrize(("size", "matrix"), [
    ((1280, 534), "bt709"), ((720, 576), "bt601"), ((720, 480), "bt601"), ((1024, 578), "bt709"),
    ((960, 540), "bt601"), ((1280, 64), "bt709"),
])  # fmt: skip
def test_matrix_of_untagged_films(tmp_path: Path, size: tuple[int, int], matrix: str) -> None:
    assert open_clip(write_film(tmp_path / "a.mkv", [size])).info.encoding.matrix == matrix


# ---- captures ----


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
        for frame in found:
            assert abs(int(frame.planes[0][0, 0]) - 20 * shown[frame.index]) <= 2


def test_hdr10_without_a_transfer_tag_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.mp4"
    mastering = "G(13250,34500)B(7500,3000)R(34000,16000)WP(15635,16450)L(10000000,1)"
    params = f"log-level=none:pools=none:bframes=0:frame-threads=1:master-display={mastering}"
    with av.open(str(path), "w") as box:
        stream = box.add_stream("libx265", rate=25, options={"x265-params": params})
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p10le"
        frame = av.VideoFrame.from_ndarray(np.full((48, 64), 128, np.uint8), "gray")
        box.mux(stream.encode(frame.reformat(format="yuv420p10le")))
        box.mux(stream.encode())
    with pytest.raises(AlreadyHdrError, match="mastering display") as caught:
        open_clip(path)
    assert "--transfer bt1886" in str(caught.value.remedy)
    with open_clip(path, InputOptions(transfer="bt1886")) as clip:
        assert clip.info.encoding.transfer == "bt1886"
    with open_clip(path, InputOptions(only_tells=True)) as clip:
        assert clip.info.encoding.transfer == "pq"


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
