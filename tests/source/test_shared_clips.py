"""Every clip of ../shared/data: what its reader must say of it, or why it is refused."""

from __future__ import annotations

from fractions import Fraction

import av
import numpy as np
import pytest
from oracles import to_rgb_code
from source_clips import DATA, read

from itmo_video.colour import linear_light
from itmo_video.errors import AlreadyHdrError, DamagedInputError, InputError
from itmo_video.source.opening import open_clip

# (frames, decoded, width, height as shown) and what else is known, or the error and its words
READ: dict[str, tuple[tuple[int, int, int, int], dict[str, object]]] = {
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
    "odd_clips/interlaced_tff_h264.mp4": ((30, 30, 720, 480), {"field_order": "tff"}),
    "odd_clips/nasa_13013_rotated.mp4": ((17, 17, 270, 480), {"rotation_deg": 270}),
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
    "odd_clips/unordered.mov": ((4, 4, 50, 50), {}),
    "odd_clips/vfr_h264.mp4": ((40, 40, 384, 216), {"is_vfr": True}),
}
REFUSED: dict[str, tuple[type[InputError | AlreadyHdrError], str]] = {
    "odd_clips/audio_only.mp3": (InputError, "no video"),
    "odd_clips/hlg_tagged_10bit.mp4": (AlreadyHdrError, "HLG"),
    "odd_clips/invalid-codec.mp4": (InputError, "codec is not supported"),
    "odd_clips/nasa_13013_hdr.mp4": (AlreadyHdrError, "PQ"),
    "odd_clips/not_a_video.mp4": (InputError, "not a readable video"),
    "odd_clips/truncated_no_moov.mp4": (InputError, "no index"),
    "odd_clips/zero_byte.webm": (InputError, "empty"),
}


@pytest.mark.shared
def test_table_is_complete() -> None:
    there = {f"{kind}/{p.name}" for kind in ("clips", "odd_clips") for p in (DATA / kind).iterdir()}
    assert there == {*READ, *REFUSED}


@pytest.mark.shared
@pytest.mark.parametrize("name", READ)
def test_conformance(name: str) -> None:
    want, known = READ[name]
    path = DATA / name
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
@pytest.mark.parametrize("name", REFUSED)
def test_refused_clips(name: str) -> None:
    error, words = REFUSED[name]
    path = DATA / name
    with pytest.raises(error, match=words) as caught:
        open_clip(path)
    assert len(str(caught.value).splitlines()) <= 2
    assert str(path) in str(caught.value)


@pytest.mark.shared
def test_change_of_size_names_the_frame() -> None:
    clip = open_clip(DATA / "odd_clips/resize_midstream.webm")
    for start in (0, 59, 80):
        with pytest.raises(
            DamagedInputError, match=f"after {max(start, 59)} frames the picture changes to 200x150"
        ):
            list(clip.frames(start))


@pytest.mark.shared
def test_known_pixels() -> None:
    green = next(open_clip(DATA / "odd_clips/2x2-green.mp4").frames())
    rgb = np.stack(to_rgb_code(green))[:, 0, 0] * 255
    assert rgb == pytest.approx((0, 128, 0), abs=3)
    black = next(open_clip(DATA / "odd_clips/all_black.mp4").frames())
    assert np.stack(linear_light.to_rgb_linear(black, clip=True)).max() < 1e-5


@pytest.mark.shared
def test_frames_are_what_ffmpeg_decodes() -> None:
    """Index, order and codes against a plain decode."""
    path = DATA / "odd_clips/vfr_h264.mp4"
    found = read(open_clip(path))
    with av.open(str(path)) as box:
        for index, frame in enumerate(box.decode(video=0)):
            luma = np.frombuffer(bytes(frame.planes[0]), np.uint8).reshape(216, -1)[:, :384]
            np.testing.assert_array_equal(found[index].planes[0], luma)
            assert frame.pts is not None
            assert frame.time_base is not None
            assert found[index].time_s == frame.pts * frame.time_base


@pytest.mark.shared
def test_rotated_clip_is_upright() -> None:
    """The clip is bars with a clock on top; upright, its size is portrait and codes are kept."""
    path = DATA / "odd_clips/nasa_13013_rotated.mp4"
    frame = next(open_clip(path).frames())
    with av.open(str(path)) as box:
        stored = next(box.decode(video=0)).to_ndarray()[:270, :480]
    np.testing.assert_array_equal(frame.planes[0], np.rot90(stored))
