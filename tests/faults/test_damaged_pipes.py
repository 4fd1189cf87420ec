"""Damaged streams through a pipe: frames, numbers and marks are those of the file."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import zlib
from pathlib import Path

import av
import command
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

import codec_clips

from itmo_video.model import Frame
from itmo_video.source.clip import Clip
from itmo_video.source.opening import open_clip
from itmo_video.source.pipe import PipeClip
from itmo_video.source.tags import InputOptions

pytestmark = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no FIFOs here")
FRAMES = 55
ELSEWHERE = {"cfhd": "nut", "png": "nut", "prores": "mkv"}  # containers that can be piped
Found = dict[int, tuple[int, bool]]  # check sum and mark by index


def made(name: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    encoder, extension, form, options = codec_clips.CODECS[name]
    row = encoder, ELSEWHERE.get(name, extension), form, options
    monkeypatch.setitem(codec_clips.CODECS, name, row)
    return codec_clips.make_clip(name, folder, FRAMES, (96, 64))


def damage(path: Path, *places: int, is_zeroed: bool = False) -> None:
    """Overwrite 40 bytes within the packets of these frames, or zero them.

    But for 8 bytes at the start, which Matroska does not store for ProRes.
    """
    data = bytearray(path.read_bytes())
    with av.open(str(path)) as box:
        packets = [bytes(packet)[8:] for packet in box.demux(video=0) if packet.size]
    assert len(packets) == FRAMES
    for place in places:
        at, size = data.index(packets[place]), len(packets[place])
        if is_zeroed:
            data[at : at + size] = bytes(size)
        else:
            begin = at + size // 2
            data[begin : begin + 40] = bytes(byte ^ 0x5A for byte in data[begin : begin + 40])
    path.write_bytes(data)


def check_sum(frame: Frame) -> int:
    check = zlib.crc32(str(frame.time_s).encode())
    for plane in frame.planes:
        check = zlib.crc32(np.ascontiguousarray(plane).data, check)
    return check


def found(clip: Clip) -> Found:
    return {frame.index: (check_sum(frame), frame.is_damaged) for frame in clip.frames()}


def from_file(path: Path) -> tuple[Found, list[int]]:
    with open_clip(path, InputOptions()) as clip:
        seen = found(clip)
        return seen, [index for index in range(clip.info.frames) if index not in seen]


def from_pipe(path: Path) -> tuple[Found, list[int]]:
    """Its frames, and the indices that are lost."""
    reading, writing = os.pipe()

    def feed() -> None:
        with os.fdopen(writing, "wb") as stream:
            stream.write(path.read_bytes())

    feeder = threading.Thread(target=feed)
    feeder.start()
    clip = PipeClip(f"/dev/fd/{reading}", InputOptions())
    with clip:
        seen = found(clip)
        assert clip.broken is None
    feeder.join()
    os.close(reading)
    return seen, clip.lost


@pytest.mark.parametrize("is_zeroed", [False, True])
@pytest.mark.parametrize(
    "name", ["mjpeg", "ffv1", "ffv1old", "cfhd", "flashsv", "png", "prores", "huffyuv", "utvideo"]
)
def test_a_damaged_stream_is_told_as_its_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, is_zeroed: bool
) -> None:
    path = made(name, tmp_path, monkeypatch)
    whole = from_file(path)
    assert from_pipe(path) == whole
    assert not any(is_damaged for _, is_damaged in whole[0].values())
    damage(path, 12, 13, 24, 40, is_zeroed=is_zeroed)
    seen, lost = from_file(path)
    assert from_pipe(path) == (seen, lost)
    if name not in ("huffyuv", "utvideo", "ffv1old"):  # without sums
        assert lost or any(is_damaged for _, is_damaged in seen.values())


@pytest.mark.parametrize("name", ["cfhd", "flashsv"])
def test_broken_packets_at_the_start_are_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """Once a packet is whole it is known that they can be checked."""
    path = made(name, tmp_path, monkeypatch)
    damage(path, 0, 1)
    seen, lost = from_file(path)
    assert lost[:2] == [0, 1]
    assert from_pipe(path) == (seen, lost)


def test_a_lost_picture_of_an_avi_is_the_frame_of_its_number(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = made("mjpeg", tmp_path, monkeypatch)
    damage(path, 29, is_zeroed=True)
    done = subprocess.run(
        [*command.COMMAND, "convert", "-", str(tmp_path / "out"), "--quiet", "--frames", "29-32"],
        input=path.read_bytes(), capture_output=True, timeout=90, env=command.ENVIRONMENT,
        check=False,
    )  # fmt: skip
    assert done.returncode == 4, done.stderr
    assert b"frame 30 did not arrive" in done.stderr
    assert b"frames 31-32 are damaged in the source" in done.stderr
    names = sorted(file.name for file in (tmp_path / "out").glob("*.exr"))
    assert names == [f"stdin.00{number}.exr" for number in (29, 31, 32)]


@pytest.mark.parametrize("place", [0, 24, 48])
def test_the_first_packet_of_a_files_stretch_is_checked_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: int
) -> None:
    """Also if its slices do not add up, as other packets say that the stream has checksums."""
    path = made("ffv1", tmp_path, monkeypatch)
    damage(path, place)
    seen, lost = from_file(path)
    assert place in lost or seen[place][1]
