"""The reader: a conformance table over all clips, one law of seeking, formats, stills, refusals."""

from __future__ import annotations

import itertools
import os
import shutil
import struct
import zlib
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from clips import SAMPLES, SHARED
from oracles import to_rgb_code

from itmo_video.colour import linear_light
from itmo_video.colour.transfer import eotf
from itmo_video.errors import AlreadyHdrError, DamagedInputError, InputError
from itmo_video.model import Encoding
from itmo_video.source import planes, tags
from itmo_video.source.code_range import outside_range
from itmo_video.source.digest import content_digest
from itmo_video.source.opening import open_clip
from itmo_video.source.tags import InputOptions

DATA = SHARED / "data"
MAKER = SAMPLES

# name: error class, or (frames, decoded, width, height as shown) and what else is known
CLIPS = {
    "clips/bigbuckbunny.mp4": ((132, 132, 1280, 720), {"matrix": "bt709"}),
    "clips/carphone_pristine.mp4": ((120, 120, 176, 144), {"pixel_aspect": Fraction(128, 117)}),
    "clips/chaplin.mp4": ((241, 241, 640, 360), {"matrix": "bt601"}),
    "clips/cvvdp_ferris-ref.mp4": ((60, 60, 1280, 720), {}),
    "clips/intel_car-detection.mp4": ((377, 377, 768, 432), {"primaries": "rec601_525"}),
    "clips/mdn_crystal.mp4": ((359, 359, 720, 480), {"frame_rate": 30}),
    "clips/mdn_frog.mp4": ((248, 248, 720, 480), {}),
    "clips/mdn_monster.mp4": ((220, 220, 720, 480), {}),
    "clips/nasa_13013.mp4": ((325, 325, 320, 180), {"matrix": "bt709", "frame_rate": 25}),
    "odd_clips/2x2-green.mp4": ((1, 1, 2, 2), {}),
    "odd_clips/all_black.mp4": ((10, 10, 320, 180), {}),
    "odd_clips/alpha_qtrle.mov": ((6, 6, 160, 90), {"has_alpha": True, "family": "rgb"}),
    "odd_clips/alpha_vp9.webm": ((20, 20, 320, 180), {"has_alpha": True, "family": "ycbcr"}),
    "odd_clips/audio_only.mp3": (InputError, "no video"),
    "odd_clips/av1_video.mkv": ((125, 125, 640, 360), {}),
    "odd_clips/bt601_full_range.mp4": ((60, 60, 320, 240), {"matrix": "bt601", "range": "full"}),
    "odd_clips/bt601_limited_range.mp4": (
        (60, 60, 320, 240),
        {"matrix": "bt601", "range": "limited"},
    ),
    "odd_clips/bt709_full_range.mp4": ((30, 30, 1280, 720), {"matrix": "bt709", "range": "full"}),
    "odd_clips/corrupted.mp4": ((50, 49, 1280, 720), {}),
    "odd_clips/discard_first_keyframe.mp4": ((25, 25, 64, 64), {}),
    "odd_clips/gray_ffv1.mkv": ((12, 12, 320, 180), {"family": "grey", "range": "full"}),
    "odd_clips/h264_10bits.mp4": ((30, 30, 200, 200), {"bit_depth": 10}),
    "odd_clips/hard_cut_and_black.mp4": ((41, 41, 640, 360), {}),
    "odd_clips/hlg_tagged_10bit.mp4": (AlreadyHdrError, "HLG"),
    "odd_clips/interlaced_tff_h264.mp4": ((30, 30, 720, 480), {"field_order": "tff"}),
    "odd_clips/invalid-codec.mp4": (InputError, "codec is not supported"),
    "odd_clips/nasa_13013_hdr.mp4": (AlreadyHdrError, "PQ"),
    "odd_clips/nasa_13013_rotated.mp4": ((17, 17, 270, 480), {"rotation_deg": 270}),
    "odd_clips/not_a_video.mp4": (InputError, "not a readable video"),
    "odd_clips/one_frame_720p.mp4": ((1, 1, 1280, 720), {}),
    "odd_clips/resize_midstream.webm": ((119, 59, 400, 300), {"is_vfr": True}),
    "odd_clips/rotate_270.mov": ((3, 3, 320, 568), {}),
    "odd_clips/sine_stereo_mp2.mpg": ((100, 100, 128, 128), {"siting": "center"}),
    "odd_clips/test_non_zero_start.mp4": (
        (12, 12, 200, 112),
        {"pixel_aspect": Fraction(224, 225), "is_vfr": False},
    ),
    "odd_clips/testsrc2_mpeg4.mp4": ((1, 1, 64, 64), {}),
    "odd_clips/testsrc2_odd_height_and_width_444.mp4": ((25, 25, 321, 241), {}),
    "odd_clips/testsrc2_odd_height_and_width_mpeg2.mp4": ((10, 10, 121, 81), {}),
    "odd_clips/testsrc2_vp9.webm": ((30, 30, 1280, 720), {"is_vfr": False}),
    "odd_clips/truncated_moov_first.mp4": ((29, 28, 1280, 720), {"frames_declared": 60}),
    "odd_clips/truncated_no_moov.mp4": (InputError, "not a readable video"),
    "odd_clips/unordered.mov": ((4, 4, 50, 50), {}),
    "odd_clips/vfr_h264.mp4": ((40, 40, 384, 216), {"is_vfr": True}),
    "odd_clips/zero_byte.webm": (InputError, "empty"),
}


def shared(name):
    return DATA / name


def read(clip, start=0, count=None):
    """Frames by index, up to the first refusal."""
    found = {}
    try:
        for frame in itertools.islice(clip.frames(start), count):
            found[frame.index] = frame
    except DamagedInputError:
        pass
    return found


def same(a, b):
    return (
        a.index == b.index
        and a.time_s == b.time_s
        and a.encoding == b.encoding
        and len(a.planes) == len(b.planes)
        and all(np.array_equal(p, q) for p, q in zip(a.planes, b.planes, strict=True))
    )


# ---- the table ----


@pytest.mark.shared
def test_table_is_complete():
    there = {f"{kind}/{p.name}" for kind in ("clips", "odd_clips") for p in (DATA / kind).iterdir()}
    assert there == set(CLIPS)


@pytest.mark.shared
@pytest.mark.parametrize("name", CLIPS)
def test_conformance(name):
    want, known = CLIPS[name]
    path = shared(name)
    if isinstance(want, type):
        with pytest.raises(want, match=known) as caught:
            open_clip(path)
        assert len(str(caught.value).splitlines()) <= 2
        assert str(path) in str(caught.value)
        return
    with open_clip(path) as clip:
        info = clip.info
        found = read(clip)
    frames, _, width, height = want
    assert (info.frames, len(found), *info.display_size) == want
    assert list(found) == sorted(found)
    assert max(found) < frames
    for field, value in known.items():
        assert getattr(info if hasattr(info, field) else info.encoding, field) == value, field
    times = [frame.time_s for frame in found.values()]
    assert times == sorted(set(times))
    for frame in found.values():
        assert frame.size == (width, height)
        assert frame.encoding == info.encoding
        for plane in frame.planes:
            assert plane.strides[1] == plane.itemsize  # lines may lie apart
            assert plane.dtype == (np.uint8 if frame.encoding.bit_depth == 8 else np.uint16)


@pytest.mark.shared
def test_change_of_size_names_the_frame():
    clip = open_clip(shared("odd_clips/resize_midstream.webm"))
    for start in (0, 59, 80):
        with pytest.raises(DamagedInputError, match=f"frame {max(start, 59)} changes to 200x150"):
            list(clip.frames(start))


@pytest.mark.shared
def test_known_pixels():
    green = next(open_clip(shared("odd_clips/2x2-green.mp4")).frames())
    rgb = np.stack(to_rgb_code(green))[:, 0, 0] * 255
    assert rgb == pytest.approx((0, 128, 0), abs=3)
    black = next(open_clip(shared("odd_clips/all_black.mp4")).frames())
    assert np.stack(linear_light.to_rgb_linear(black, clip=True)).max() < 1e-5


@pytest.mark.shared
def test_frames_are_what_ffmpeg_decodes():
    """Index, order and codes against a plain decode."""
    path = shared("odd_clips/vfr_h264.mp4")
    found = read(open_clip(path))
    with av.open(str(path)) as box:
        for index, frame in enumerate(box.decode(video=0)):
            luma = np.frombuffer(frame.planes[0], np.uint8).reshape(216, -1)[:, :384]
            np.testing.assert_array_equal(found[index].planes[0], luma)
            assert found[index].time_s == frame.pts * frame.time_base


# ---- the law: a frame is the same wherever reading starts ----


def write_scene(path, codec, count=40, *, stored="yuv420p", options=None, size=(96, 64), **box_kw):
    rng = np.random.default_rng(1)
    noise = cv2.GaussianBlur(rng.normal(0, 1, (size[1], size[0] + 3 * count, 3)), (0, 0), 3)
    scene = cv2.normalize(noise, None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8)
    with av.open(os.fspath(path), "w", **box_kw) as box:
        stream = box.add_stream(codec, rate=25, options=options or {})
        stream.width, stream.height = size
        stream.pix_fmt = stored
        if "g" in (options or {}):
            stream.codec_context.gop_size = int(options["g"])
        for n in range(count):
            picture = np.ascontiguousarray(scene[:, 3 * n : 3 * n + size[0]])
            frame = av.VideoFrame.from_ndarray(picture, "rgb24").reformat(format=stored, threads=1)
            frame.pts = n
            box.mux(stream.encode(frame))
        box.mux(stream.encode())
    return path


X264 = {"x264-params": "keyint=10:min-keyint=10:bframes=3:open-gop=1:scenecut=0"}
X265 = {"x265-params": "keyint=10:open-gop=1:bframes=3:log-level=none"}
STREAMS = {
    "open.mp4": ("libx264", X264),
    "open.mkv": ("libx264", X264),
    "open.ts": ("libx264", X264),
    "open.avi": ("libx264", X264),
    "open.flv": ("libx264", X264),
    "open.h264": ("libx264", X264),
    "refresh.mp4": ("libx264", {"x264-params": "keyint=10:intra-refresh=1:bframes=2"}),
    "hevc.mp4": ("libx265", X265),
    "hevc.ts": ("libx265", X265),
    "mpeg2.mpg": ("mpeg2video", {"g": "10", "bf": "2"}),
    "mpeg2.mxf": ("mpeg2video", {"g": "10", "bf": "2"}),
    "mpeg4.avi": ("mpeg4", {"g": "10", "bf": "2"}),
    "vp8.webm": ("libvpx", {"g": "10", "auto-alt-ref": "1", "lag-in-frames": "12"}),
    "vp9.webm": ("libvpx-vp9", {"g": "10", "auto-alt-ref": "1", "lag-in-frames": "12"}),
}


@pytest.mark.parametrize("name", STREAMS)
def test_a_frame_does_not_depend_on_the_start(tmp_path, name):
    codec, options = STREAMS[name]
    clip = open_clip(write_scene(tmp_path / name, codec, options=options))
    whole = read(clip)
    assert list(whole) == list(range(40))
    assert clip.info.frames == 40
    assert clip.info.frame_rate == 25
    for start in (*range(0, 40, 3), 38, 39):
        part = read(clip, start, 4)
        assert list(part) == list(range(start, min(start + 4, 40)))
        assert all(same(frame, whole[n]) for n, frame in part.items())


@pytest.mark.shared
@pytest.mark.parametrize("name", ["corrupted.mp4", "truncated_moov_first.mp4", "unordered.mov",
    "discard_first_keyframe.mp4", "interlaced_tff_h264.mp4", "sine_stereo_mp2.mpg",
    "nasa_13013_rotated.mp4", "alpha_vp9.webm", "vfr_h264.mp4"])  # fmt: skip
def test_odd_clips_do_not_depend_on_the_start(name):
    clip = open_clip(shared(f"odd_clips/{name}"))
    whole = read(clip)
    frames = clip.info.frames
    for start in sorted({1, 2, frames // 3, frames // 2, frames - 2, frames - 1}):
        part = read(clip, start, 3)
        assert list(part) == [n for n in whole if n >= start][:3]
        assert all(same(frame, whole[n]) for n, frame in part.items())


def test_start_beyond_the_end_gives_nothing(tmp_path):
    clip = open_clip(write_scene(tmp_path / "a.mp4", "libx264", 5))
    assert list(clip.frames(5)) == []
    assert list(clip.frames(99)) == []


def test_cut_off_files_tell_what_is_missing(tmp_path):
    whole = write_scene(tmp_path / "whole.mkv", "libx264", options=X264)
    cut = tmp_path / "cut.mkv"
    data = whole.read_bytes()
    cut.write_bytes(data[: len(data) // 2])
    clip = open_clip(cut)
    assert clip.info.frames_declared == pytest.approx(40, abs=1)
    assert 10 < clip.info.frames < 30
    assert any("truncated" in notice for notice in clip.info.notices)
    whole_frames = read(open_clip(whole))
    for n, frame in read(clip).items():
        assert frame.is_damaged or n > clip.info.frames - 6 or same(frame, whole_frames[n])


# ---- colour through a file ----


def write_planes(path, stored, code_planes, **tags):
    """A lossless clip of one frame with exactly these codes."""
    height, width = code_planes[0].shape
    return write_raw(path, stored, code_planes, width, height, **tags)


def write_packed(path, stored, codes, width):
    return write_raw(path, stored, [codes], width, len(codes))


def write_raw(path, stored, code_planes, width, height, **tags):
    with av.open(os.fspath(path), "w") as box:
        stream = box.add_stream("ffv1", rate=24)
        stream.width, stream.height, stream.pix_fmt = width, height, stored
        frame = av.VideoFrame(width, height, stored)
        for plane, codes in zip(frame.planes, code_planes, strict=True):
            raw = np.zeros((plane.height, plane.line_size), np.uint8)
            rows = np.ascontiguousarray(codes).view(np.uint8)
            raw[:, : rows.shape[1]] = rows
            plane.update(raw)
        for name, value in tags.items():
            setattr(frame, name, value)
            setattr(stream.codec_context, name, value)
        frame.pts = 0
        box.mux(stream.encode(frame))
        box.mux(stream.encode())
    return path


BARS = np.array(
    [[1, 1, 1], [0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [0, 1, 1], [1, 0, 1],
     [0.5, 0.5, 0.5], [0.75, 0.25, 0.1], [0.02, 0.03, 0.01]]
)  # fmt: skip
KR_KB = {"bt709": (0.2126, 0.0722), "bt601": (0.299, 0.114), "bt2020": (0.2627, 0.0593)}
NUMBER = {"bt709": 1, "bt601": 6, "bt2020": 9}


@pytest.mark.parametrize("layout", ["420", "422", "444"])
@pytest.mark.parametrize(("matrix", "range_", "depth"), [
    ("bt709", "limited", 8), ("bt709", "full", 8), ("bt601", "limited", 8), ("bt601", "full", 8),
    ("bt2020", "limited", 10), ("bt709", "limited", 12),
])  # fmt: skip
def test_bars_come_out_right(tmp_path, layout, matrix, range_, depth):
    kr, kb = KR_KB[matrix]
    luma = BARS @ [kr, 1 - kr - kb, kb]
    ycc = np.stack(
        [luma, (BARS[:, 2] - luma) / 2 / (1 - kb), (BARS[:, 0] - luma) / 2 / (1 - kr)], 1
    )
    step, top = 2 ** (depth - 8), 2**depth - 1
    spans = np.array([219, 224, 224]) * step if range_ == "limited" else np.array([top] * 3)
    base = np.array([16 if range_ == "limited" else 0, 128, 128]) * step
    codes = np.clip(np.round(ycc * spans + base), 0, top)
    stored = (codes - base) / spans  # what the codes say exactly; quantised, so not BARS
    red = stored[:, 0] + 2 * (1 - kr) * stored[:, 2]
    blue = stored[:, 0] + 2 * (1 - kb) * stored[:, 1]
    green = (stored[:, 0] - kr * red - kb * blue) / (1 - kr - kb)
    want = np.clip(np.stack([red, green, blue], 1), 0, 1) ** 2.4

    wide = np.repeat(codes, 16, axis=0).astype(np.uint8 if depth == 8 else np.uint16)
    full = [np.tile(wide[:, i], (32, 1)) for i in range(3)]
    across, down = {"420": (2, 2), "422": (2, 1), "444": (1, 1)}[layout]
    code_planes = [full[0], *(p[::down, ::across].copy() for p in full[1:])]
    path = write_planes(
        tmp_path / "bars.mkv",
        f"yuv{layout}p" + ("" if depth == 8 else f"{depth}le"),
        code_planes,
        colorspace=NUMBER[matrix],
        color_range={"limited": 1, "full": 2}[range_],
        color_trc=1,
        color_primaries=1,
    )
    frame = next(open_clip(path).frames())
    enc = frame.encoding
    assert (enc.matrix, enc.range, enc.bit_depth, enc.transfer) == (matrix, range_, depth, "bt1886")
    assert set(enc.origins.values()) == {"tag"}
    for plane, codes_in in zip(frame.planes, code_planes, strict=True):
        np.testing.assert_array_equal(plane, codes_in)
    got = np.stack(linear_light.to_rgb_linear(frame, clip=True), -1)
    for i in range(len(BARS)):
        inner = got[4:-4, 16 * i + 4 : 16 * i + 12]
        np.testing.assert_allclose(inner, np.broadcast_to(want[i], inner.shape), atol=1 / 1023)
    np.testing.assert_allclose(got[4:-4, 4:12], 1, atol=0.001)


def test_rgb_bars_are_exact(tmp_path):
    codes = np.repeat(np.round(BARS * 255).astype(np.uint8), 4, axis=0)
    rgb = np.tile(codes, (8, 1, 1))
    packed = np.dstack([rgb[..., ::-1], np.zeros(rgb.shape[:2], np.uint8)]).reshape(len(rgb), -1)
    path = write_packed(tmp_path / "rgb.mkv", "bgr0", packed, rgb.shape[1])
    frame = next(open_clip(path).frames())
    assert (frame.encoding.family, frame.encoding.transfer) == ("rgb", "srgb")
    got = np.stack(linear_light.to_rgb_linear(frame, clip=True), -1)
    np.testing.assert_allclose(got, eotf(rgb / 255, "srgb"), atol=1e-6)


# ---- tags, overrides, refusals ----


def tagged(tmp_path, **tags):
    planes = [np.full((4, 8), 100, np.uint8), *[np.full((2, 4), 128, np.uint8)] * 2]
    return write_planes(tmp_path / "t.mkv", "yuv420p", planes, **tags)


@pytest.mark.parametrize(("trc", "transfer"), [
    (1, "bt1886"), (6, "bt1886"), (14, "bt1886"), (13, "srgb"), (4, "gamma22"), (2, "bt1886"),
])  # fmt: skip
def test_transfer_tags(tmp_path, trc, transfer):
    enc = open_clip(tagged(tmp_path, color_trc=trc)).info.encoding
    assert enc.transfer == transfer
    assert enc.origins["transfer"] == ("assumed" if trc == 2 else "tag")


@pytest.mark.parametrize("trc", [8, 9, 10, 16, 18])
def test_hdr_tags_are_refused_unless_overruled(tmp_path, trc):
    path = tagged(tmp_path, color_trc=trc)
    with pytest.raises(AlreadyHdrError, match="--force-sdr"):
        open_clip(path)
    assert open_clip(path, InputOptions(force_sdr=True)).info.encoding.transfer == "bt1886"
    enc = open_clip(path, InputOptions(transfer="gamma22")).info.encoding
    assert (enc.transfer, enc.origins["transfer"]) == ("gamma22", "set")


def test_options_overrule_tags(tmp_path):
    path = tagged(tmp_path, colorspace=1, color_range=1)
    enc = open_clip(path, InputOptions(matrix="bt2020", range="full")).info.encoding
    assert (enc.matrix, enc.range) == ("bt2020", "full")
    assert (enc.origins["matrix"], enc.origins["range"]) == ("set", "set")


def test_unknown_matrix_needs_the_users_word(tmp_path):
    path = tagged(tmp_path, colorspace=8)
    with pytest.raises(InputError, match="YCgCo"):
        open_clip(path)
    assert open_clip(path, InputOptions(matrix="bt709")).info.encoding.matrix == "bt709"


@pytest.mark.parametrize("primaries", [(1, "rec709"), (5, "rec601_625"), (6, "rec601_525"),
    (9, "rec2020"), (12, "p3d65"), (2, "rec709")])  # fmt: skip
def test_primaries_tags(tmp_path, primaries):
    number, name = primaries
    assert open_clip(tagged(tmp_path, color_primaries=number)).info.encoding.primaries == name


def test_too_many_pixels_are_refused_before_decoding(tmp_path):
    path = write_scene(tmp_path / "a.mp4", "libx264", 3)
    for options in (InputOptions(max_pixels=96 * 64 - 1), InputOptions(max_pixels=1)):
        with pytest.raises(InputError, match="--max-pixels"):
            open_clip(path, options)
    assert open_clip(path, InputOptions(max_pixels=96 * 64)).info.frames == 3
    png = tmp_path / "bomb.png"
    png.write_bytes(png_bytes(60000, 60000, 2, b""))
    with pytest.raises(InputError, match="60000x60000"):
        open_clip(png)


def test_playlists_are_refused(tmp_path):
    target = write_scene(tmp_path / "a.ts", "libx264", 3)
    for name, text in (
        ("list.m3u8", f"#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\n{target}\n#EXT-X-ENDLIST\n"),
        ("list.ffconcat", f"ffconcat version 1.0\nfile '{target}'\n"),
        ("list.sdp", "v=0\no=- 0 0 IN IP4 127.0.0.1\nm=video 9 RTP/AVP 96\n"),
    ):
        playlist = tmp_path / name
        playlist.write_text(text)
        with pytest.raises(InputError):
            open_clip(playlist)


def test_what_cannot_be_opened_says_why(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        open_clip(tmp_path / "none.mp4")
    with pytest.raises(InputError, match="folder"):
        open_clip(tmp_path)
    with pytest.raises(InputError, match="no file matches"):
        open_clip(tmp_path / "img.%04d.png")
    os.mkfifo(tmp_path / "pipe.mp4")
    writer = os.open(tmp_path / "pipe.mp4", os.O_RDWR)
    with pytest.raises(InputError, match="not a regular file"):
        open_clip(tmp_path / "pipe.mp4")
    os.close(writer)
    hdr = tmp_path / "a.hdr"
    hdr.write_bytes(b"#?RADIANCE\n")
    with pytest.raises(AlreadyHdrError):
        open_clip(hdr)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_no_permission_is_said(tmp_path):
    path = tmp_path / "a.mp4"
    path.write_bytes(b"x")
    path.chmod(0)
    with pytest.raises(InputError, match=r"[Pp]ermission"):
        open_clip(path)


@pytest.mark.parametrize("name", [b"a b.mp4", b"c:d.mp4", b"http:x.mp4", b"e%04d.mp4", b"f\ng.mp4",
    b"-h.mp4", b"\xff\xfe.mp4", "\u00fc\u6620.mp4".encode()])  # fmt: skip
def test_odd_names(tmp_path, name, monkeypatch):
    source = write_scene(tmp_path / "source.mp4", "libx264", 2)
    try:
        shutil.copy(source, os.path.join(os.fsencode(tmp_path), name))
    except OSError:
        pytest.skip("this file system has no such names")
    assert open_clip(tmp_path / os.fsdecode(name)).info.frames == 2
    monkeypatch.chdir(tmp_path)
    assert len(read(open_clip(os.fsdecode(name)))) == 2


def test_tags_that_are_not_utf8_are_no_obstacle(tmp_path):
    path = write_scene(tmp_path / "a.mkv", "libx264", 3)
    with av.open(str(path)) as was, av.open(str(tmp_path / "b.mkv"), "w") as box:
        stream = box.add_stream_from_template(was.streams.video[0])
        box.metadata.update(title="TITLETITLE", timecode="QQQQQQQQ")
        for packet in was.demux(video=0):
            if packet.size:
                packet.stream = stream
                box.mux(packet)
    data = (tmp_path / "b.mkv").read_bytes().replace(b"TIMECODE", b"timecode")
    for ascii_only in (b"TITLETITLE", b"QQQQQQQQ"):
        assert ascii_only in data
        data = data.replace(ascii_only, ascii_only[:3] + b"\xfc\xe9" + ascii_only[5:])
    (tmp_path / "b.mkv").write_bytes(data)
    info = open_clip(tmp_path / "b.mkv").info
    assert info.frames == 3
    assert info.timecode == "QQQ??QQQ", "must be printable"


def test_digest_is_of_the_content(tmp_path):
    a = write_scene(tmp_path / "a.mp4", "libx264", 3)
    b = Path(shutil.copy(a, tmp_path / "b.mp4"))
    assert open_clip(a).info.digest == open_clip(b).info.digest == content_digest([a])
    c = write_scene(tmp_path / "c.mp4", "libx264", 4)
    assert content_digest([a]) != content_digest([c])
    big = tmp_path / "big"
    with big.open("wb") as file:
        file.truncate(70 << 20)
    before = content_digest([big])
    with big.open("r+b") as file:
        file.seek(69 << 20)
        file.write(b"x")
    assert content_digest([big]) != before


# ---- pixel formats ----


@pytest.mark.parametrize("form", ["rgb24", "bgr24", "rgba", "bgra", "argb", "abgr", "rgb48le",
    "rgb48be", "rgba64le", "rgba64be", "gbrp", "gbrap", "gbrp10le", "gbrp16le", "gray", "gray10le",
    "gray16le", "gray16be", "rgb0", "0bgr"])  # fmt: skip
def test_rgb_kinds_give_their_codes(form):
    rng = np.random.default_rng(5)
    deep = any(mark in form for mark in ("16", "10", "48", "64"))
    depth = 10 if "10" in form else 16 if deep else 8
    frame = av.VideoFrame(37, 5, form)
    dtype = np.dtype(">u2" if form.endswith("be") else "<u2" if deep else "u1")
    raws = []
    for plane in frame.planes:
        raw = np.zeros((plane.height, plane.line_size // dtype.itemsize), dtype)
        raw[:] = rng.integers(0, 2**depth, raw.shape)
        plane.update(np.ascontiguousarray(raw).view(np.uint8))
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
def test_ycbcr_kinds_equal_the_planar_one(form, planar):
    rng = np.random.default_rng(6)
    source = av.VideoFrame(38, 10, planar)
    deep = "10" in planar
    for plane in source.planes:
        raw = rng.integers(0, 1024 if deep else 256, (plane.height, plane.line_size // (1 + deep)))
        plane.update(np.ascontiguousarray(raw.astype("<u2" if deep else "u1")).view(np.uint8))
    want = planes.read_picture(source)
    got = planes.read_picture(source.reformat(format=form, threads=1))  # its slices race
    assert (got.family, got.bit_depth, got.has_alpha) == ("ycbcr", want.bit_depth, False)
    for a, b in zip(got.planes, want.planes, strict=True):
        np.testing.assert_array_equal(a, b)
        assert a.flags.c_contiguous


@pytest.mark.parametrize("form", ["grayf32le", "gbrpf32le"])
def test_floats_are_hdr(form):
    with pytest.raises(AlreadyHdrError):
        planes.read_picture(av.VideoFrame(8, 8, form))


@pytest.mark.parametrize("form", ["monob", "monow", "rgb565le", "x2rgb10le", "vuya"])
def test_rare_kinds_are_unpacked(form):
    picture = planes.read_picture(av.VideoFrame(8, 8, form))
    assert all(plane.shape == (8, 8) for plane in picture.planes)


@pytest.mark.parametrize("stored", ["yuv411p", "yuv410p"])
def test_quarter_chroma_is_brought_to_full_size(tmp_path, stored):
    clip = open_clip(write_scene(tmp_path / "a.mkv", "ffv1", 2, stored=stored))
    frame = next(clip.frames())
    assert {plane.shape for plane in frame.planes} == {(64, 96)}
    assert (frame.encoding.bit_depth, frame.encoding) == (16, clip.info.encoding)


def test_upside_down_rgb_is_turned(tmp_path):
    """Uncompressed AVI is stored from the bottom row up."""
    path = write_scene(tmp_path / "a.avi", "rawvideo", 2, stored="bgr24")
    frame = next(open_clip(path).frames())
    with av.open(str(path)) as box:
        want = (
            next(box.decode(video=0)).reformat(format="gbrp", threads=1).to_ndarray(format="rgb24")
        )
    np.testing.assert_array_equal(np.stack(frame.planes, -1), want)


# ---- upright ----

ALL_TURNS = list(itertools.product((0, 90, 180, 270), (False, True)))


@pytest.mark.parametrize("turn", ALL_TURNS)
@pytest.mark.parametrize("size", [(12, 8), (13, 8), (12, 7), (13, 7)])
@pytest.mark.parametrize(("layout", "siting"), [
    ("420", "left"), ("420", "center"), ("420", "topleft"), ("422", "left"), ("444", "left"),
])  # fmt: skip
def test_turning_planes_turns_the_picture(turn, size, layout, siting):
    rng = np.random.default_rng(8)
    across, down = {"420": (2, 2), "422": (2, 1), "444": (1, 1)}[layout]
    small = (-(-size[1] // down), -(-size[0] // across))
    stored = tuple(
        rng.integers(30, 220, shape, dtype=np.uint8) for shape in (size[::-1], small, small)
    )
    enc = Encoding("ycbcr", 8, "bt709", "limited", "bt1886", "rec709", siting)
    frame = planes_frame(stored, enc)
    want = np.stack(to_rgb_code(frame))
    if turn[1]:
        want = want[:, :, ::-1]
    want = np.rot90(want, -turn[0] // 90, axes=(1, 2))
    got = np.stack(to_rgb_code(planes_frame(*planes.upright(stored, turn, enc))))
    np.testing.assert_allclose(got, want, atol=1e-5)


def planes_frame(stored, enc):
    from itmo_video.model import Frame

    return Frame(0, Fraction(0), stored, enc)


@pytest.mark.parametrize("turn", ALL_TURNS)
def test_display_matrices(turn):
    angle, flip = np.radians(turn[0]), turn[1]
    mirror = np.diag([-1.0 if flip else 1.0, 1.0])
    rotate = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    (a, b), (c, d) = np.round(mirror @ rotate * 65536).astype(int)
    assert tags.matrix_turn([a, b, 0, c, d, 0, 0, 0, 1 << 30]) == turn


@pytest.mark.shared
def test_rotated_clip_is_upright():
    """The clip is bars with a clock on top; upright, its size is portrait and codes are kept."""
    path = shared("odd_clips/nasa_13013_rotated.mp4")
    frame = next(open_clip(path).frames())
    with av.open(str(path)) as box:
        stored = next(box.decode(video=0)).to_ndarray()[:270, :480]
    np.testing.assert_array_equal(frame.planes[0], np.rot90(stored))


# ---- interlaced ----


@pytest.mark.shared
def test_flagged_fields_are_deinterlaced_and_said():
    path = shared("odd_clips/interlaced_tff_h264.mp4")
    kept = next(open_clip(path, InputOptions(deinterlace="off")).frames(7))
    made = next(open_clip(path).frames(7))

    def comb(frame):
        luma = frame.planes[0].astype(float)
        return np.abs(luma[1:-1] - (luma[:-2] + luma[2:]) / 2).mean()

    assert comb(made) < 0.8 * comb(kept)
    assert any("deinterlaced" in notice for notice in open_clip(path).info.notices)
    assert made.time_s == kept.time_s


def test_progressive_clips_are_deinterlaced_by_force_only(tmp_path):
    path = write_scene(tmp_path / "a.mp4", "libx264", 8)
    plain, forced = (read(open_clip(path, InputOptions(deinterlace=m))) for m in ("auto", "force"))
    assert list(plain) == list(forced) == list(range(8))
    assert not same(plain[3], forced[3])


# ---- stills and sequences ----


def png_bytes(width, height, kind, data, *extra, depth=8):
    def chunk(name, body):
        return (
            struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))
        )

    head = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, depth, kind, 0, 0, 0))
    body = b"".join(chunk(name, value) for name, value in extra)
    image = chunk(b"IDAT", zlib.compress(data))
    return b"\x89PNG\r\n\x1a\n" + head + body + image + chunk(b"IEND", b"")


def picture(height=24, width=38, dtype=np.uint8, channels=3, seed=0):
    top = np.iinfo(dtype).max + 1
    shape = (height, width, channels) if channels > 1 else (height, width)
    return np.random.default_rng(seed).integers(0, top, shape, dtype=dtype)


def write_image(path, image):
    assert cv2.imwrite(os.fspath(path), image)
    return path


@pytest.mark.parametrize(("ext", "dtype"), [*itertools.product((".png", ".tiff", ".ppm"),
    (np.uint8, np.uint16)), (".bmp", np.uint8)])  # fmt: skip
def test_lossless_stills_are_exact(tmp_path, ext, dtype):
    image = picture(dtype=dtype)
    clip = open_clip(write_image(tmp_path / f"still{ext}", image))
    (frame,) = clip.frames()
    assert (clip.info.frames, clip.info.first_number, clip.info.stem) == (1, None, "still")
    assert (frame.encoding.family, frame.encoding.transfer) == ("rgb", "srgb")
    assert (frame.encoding.range, frame.encoding.bit_depth) == ("full", 8 * dtype().itemsize)
    np.testing.assert_array_equal(np.stack(frame.planes, -1), image[..., ::-1])
    assert list(clip.frames(1)) == []


def test_grey_alpha_and_palette_pngs(tmp_path):
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


def test_jpeg_comes_as_srgb(tmp_path):
    image = np.full((32, 48, 3), (40, 90, 200), np.uint8)
    clip = open_clip(write_image(tmp_path / "a.jpg", image))
    enc = clip.info.encoding
    assert (enc.family, enc.range, enc.transfer, enc.primaries) == ("rgb", "full", "srgb", "rec709")
    told = open_clip(tmp_path / "a.jpg", InputOptions(matrix="bt709")).info.notices
    assert any("ignored" in notice for notice in told)
    got = np.stack(to_rgb_code(next(clip.frames())), -1) * 255
    np.testing.assert_allclose(got, np.broadcast_to((200, 90, 40), got.shape), atol=1.5)


def exif(orientation):
    return b"II*\0" + struct.pack("<IHHHIII", 8, 1, 0x0112, 3, 1, orientation, 0)


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("size", [(24, 38), (21, 33)])
def test_exif_orientation(tmp_path, orientation, size):
    smooth = cv2.resize(picture(3, 4), size[::-1], interpolation=cv2.INTER_CUBIC)
    data = cv2.imencode(".jpg", smooth, [cv2.IMWRITE_JPEG_QUALITY, 98])[1].tobytes()
    body = b"Exif\0\0" + exif(orientation)
    path = tmp_path / "a.jpg"
    path.write_bytes(data[:2] + b"\xff\xe1" + struct.pack(">H", len(body) + 2) + body + data[2:])
    want = cv2.imread(str(path))[..., ::-1]
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


@pytest.mark.parametrize("pattern", ["img.%04d.png", "img.####.png"])
def test_sequences_keep_their_numbers_and_holes(tmp_path, pattern):
    images = {n: picture(seed=n) for n in (8, 9, 10, 12, 10000)}
    del images[10000]
    for n, image in images.items():
        write_image(tmp_path / f"img.{n:04d}.png", image)
    write_image(tmp_path / "img.99.png", picture())  # too few digits for the pattern
    clip = open_clip(tmp_path / pattern)
    info = clip.info
    assert (info.frames, info.first_number, info.stem) == (5, 8, "img")
    for start in range(6):
        found = read(clip, start)
        assert list(found) == [n - 8 for n in images if n - 8 >= start]
        for index, frame in found.items():
            np.testing.assert_array_equal(np.stack(frame.planes, -1), images[index + 8][..., ::-1])
            assert frame.time_s == index / info.frame_rate


def test_sequences_skip_damaged_images_and_refuse_other_sizes(tmp_path):
    for n in range(3):
        write_image(tmp_path / f"{n}.png", picture(seed=n))
    (tmp_path / "1.png").write_bytes(b"\x89PNG\r\n\x1a\nrubbish")
    clip = open_clip(tmp_path / "%d.png")
    assert list(read(clip)) == [0, 2]
    write_image(tmp_path / "3.png", picture(height=10))
    with pytest.raises(DamagedInputError, match="38x10") as caught:
        list(open_clip(tmp_path / "%d.png").frames())
    assert "3.png" in str(caught.value)


def test_damaged_stills_are_refused(tmp_path):
    path = tmp_path / "a.png"
    path.write_bytes(b"\x89PNG\r\n\x1a\nrubbish that goes on for a while")
    with pytest.raises(InputError, match="cannot be decoded"):
        open_clip(path)


def test_iterators_run_side_by_side(tmp_path):
    clip = open_clip(write_scene(tmp_path / "a.mp4", "libx264", 12, options=X264))
    whole = read(clip)
    first, second = clip.frames(2), clip.frames(5)
    for n in range(5):
        assert same(next(first), whole[2 + n])
        assert same(next(second), whole[5 + n])
    first.close()
    second.close()


@pytest.mark.parametrize(("bars", "inside", "told"), [(0, 3, True), (16, 90, False), (16, 3, True)])
def test_bars_of_code_0_do_not_ask_for_full_range(bars: int, inside: int, told: bool) -> None:
    luma = np.full((96, 160), 90, np.uint8)
    luma[:8], luma[8:12, 16:-16] = 90, inside
    luma[:, :bars] = luma[:, 160 - bars :] = 0
    picture = planes.Picture("ycbcr", 8, False, (luma, *[np.full((48, 80), 128, np.uint8)] * 2))
    encoding = Encoding("ycbcr", 8, "bt709", "limited", "bt1886", "rec709")
    assert bool(outside_range(picture, encoding)) == told
