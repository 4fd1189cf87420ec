"""One law of seeking: a frame is the same wherever reading starts."""

from __future__ import annotations

from pathlib import Path

import pytest
from source_clips import DATA, X264, X265, read, same, write_scene

from itmo_video.source.opening import open_clip

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
def test_a_frame_does_not_depend_on_the_start(tmp_path: Path, name: str) -> None:
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
def test_odd_clips_do_not_depend_on_the_start(name: str) -> None:
    clip = open_clip(DATA / f"odd_clips/{name}")
    whole = read(clip)
    frames = clip.info.frames
    for start in sorted({1, 2, frames // 3, frames // 2, frames - 2, frames - 1}):
        part = read(clip, start, 3)
        assert list(part) == [n for n in whole if n >= start][:3]
        assert all(same(frame, whole[n]) for n, frame in part.items())


def test_start_beyond_the_end_gives_nothing(tmp_path: Path) -> None:
    clip = open_clip(write_scene(tmp_path / "a.mp4", "libx264", 5))
    assert list(clip.frames(5)) == []
    assert list(clip.frames(99)) == []


def test_cut_off_files_tell_what_is_missing(tmp_path: Path) -> None:
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


def test_iterators_run_side_by_side(tmp_path: Path) -> None:
    clip = open_clip(write_scene(tmp_path / "a.mp4", "libx264", 12, options=X264))
    whole = read(clip)
    first, second = clip.frames(2), clip.frames(5)
    for n in range(5):
        assert same(next(first), whole[2 + n])
        assert same(next(second), whole[5 + n])
