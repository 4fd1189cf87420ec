"""HDR that hides: Dolby Vision, camera log and HDR10 without a transfer tag are refused."""

from __future__ import annotations

import struct
from pathlib import Path

import av
import numpy as np
import pytest
from source_clips import write_streams

from itmo_video.errors import AlreadyHdrError
from itmo_video.source import hidden_hdr
from itmo_video.source.opening import open_clip
from itmo_video.source.tags import InputOptions
from itmo_video.source.track_facts import DolbyVision, TrackFacts


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
    path = write_streams(tmp_path / "a.mp4", [(64, 48)])
    xml = b'<Item name="CaptureGammaEquation" value="s-log3-cine"/>'
    path.write_bytes(path.read_bytes() + struct.pack(">I", 8 + len(xml)) + b"free" + xml)
    with pytest.raises(AlreadyHdrError, match="s-log3"):
        open_clip(path)
    assert open_clip(path, InputOptions(transfer="bt1886")).info.frames == 12


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
