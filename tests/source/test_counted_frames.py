"""Streams without usable stamps: what damage costs is said, and sound ones lose nothing."""

from __future__ import annotations

from pathlib import Path

import av
import pytest
from source_clips import write_scene

from itmo_video import RunOptions, convert, make_settings, open_clip
from itmo_video.errors import DamagedInputError
from itmo_video.source.counted_frames import _damaged, _missing
from itmo_video.source.tags import InputOptions

X264 = "keyint=8:min-keyint=8:scenecut=0:threads=1"
X265 = "keyint=8:min-keyint=8:log-level=none:pools=none:frame-threads=1"
SOUND: dict[str, tuple[str, dict[str, str]]] = {
    "b.hevc": ("libx265", {"x265-params": X265 + ":bframes=3:open-gop=0"}),
    "open.hevc": ("libx265", {"x265-params": X265 + ":bframes=3:open-gop=1"}),
    "b.h264": ("libx264", {"x264-params": X264 + ":bframes=3"}),
    "open.h264": ("libx264", {"x264-params": X264 + ":bframes=3:open-gop=1"}),
    "fields.h264": ("libx264", {"x264-params": X264 + ":interlaced=1"}),
    "refresh.h264": ("libx264", {"x264-params": X264 + ":intra-refresh=1:bframes=0"}),
    "b.m2v": ("mpeg2video", {"bf": "2", "g": "8"}),
}


def packets_of(path: Path) -> list[bytes]:
    with av.open(str(path)) as box:
        return [bytes(packet) for packet in box.demux(video=0) if packet.size]


def with_zeros(path: Path, place: int) -> Path:
    """The stream with the end of one packet's first slice header and of its data zeroed."""
    packets = packets_of(path)
    packets[place] = packets[place][:7] + bytes(len(packets[place]) - 7)
    damaged = path.with_stem("damaged")
    damaged.write_bytes(b"".join(packets))
    return damaged


@pytest.mark.parametrize("name", SOUND)
def test_a_sound_stream_loses_nothing(name: str, tmp_path: Path) -> None:
    encoder, options = SOUND[name]
    path = write_scene(tmp_path / name, encoder, 24, options=options)
    with open_clip(path, InputOptions(deinterlace="off")) as clip:
        assert clip.info.frames_cut_off == 0
        assert not any("damaged" in notice for notice in clip.info.notices)
        assert [frame.index for frame in clip.frames() if not frame.is_damaged] == [*range(24)]


@pytest.mark.parametrize("name", ["b.hevc", "open.hevc", "b.h264"])
def test_the_frames_that_damage_costs_are_counted(name: str, tmp_path: Path) -> None:
    encoder, options = SOUND[name]
    path = with_zeros(write_scene(tmp_path / name, encoder, 24, options=options), 11)
    with open_clip(path) as clip:
        found = [frame.is_damaged for frame in clip.frames()]
    assert len(found) < 24 or any(found)
    lost = 24 - len(found)
    assert clip.info.frames_cut_off == lost
    said = f"damaged: 24 packets gave only {24 - lost} frames"
    assert any(said in notice for notice in clip.info.notices) == (lost > 0)
    with pytest.raises(DamagedInputError, match="damaged"):
        convert(path, tmp_path / "out", make_settings(), RunOptions(jobs=1))
    with pytest.raises(DamagedInputError, match="damaged"):  # nor does a later run keep silent
        convert(path, tmp_path / "out", make_settings(), RunOptions(jobs=1))


def test_a_stream_that_ends_within_a_packet_has_lost_a_frame(tmp_path: Path) -> None:
    encoder, options = SOUND["b.hevc"]
    path = write_scene(tmp_path / "b.hevc", encoder, 24, options=options)
    packets = packets_of(path)
    path.write_bytes(b"".join(packets[:21]) + packets[21][:9])
    with open_clip(path) as clip:
        assert (clip.info.frames, clip.info.frames_cut_off) == (21, 1)


def test_a_frame_may_be_two_packets() -> None:
    fields = [*range(0, 20, 2)]
    assert _missing(20, fields[:6] + fields[8:], [12, 13, 14, 15]) == 2
    assert _missing(10, [0, 1, 2, 3, 4, 5, 8, 9], [6, 7]) == 2
    assert _missing(10, [*range(10)], [6]) == 0


def test_damage_ends_at_the_next_key_but_for_frames_shown_before_it() -> None:
    shown = [0, 2, 1, 3, 5, 6, 4, 7]  # packet 4 is a key; 5 and 6 refer to it and to those before
    assert _damaged(shown, [3], [0, 4]) == {3, 4, 5}
    assert _damaged(shown, [2], [0]) == {1, 3, 4, 5, 6, 7}
