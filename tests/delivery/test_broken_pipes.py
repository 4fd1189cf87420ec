"""Pipes that break off, at either end: what is missing is told, and a reader may leave."""

from __future__ import annotations

import os
import subprocess
import threading
from pathlib import Path
from typing import Any

import av
import clips
import command
import pytest
from piping import COUNT, piped

from itmo_video import open_clip
from itmo_video.source.pipe import PipeClip
from itmo_video.source.tags import InputOptions


def test_frames_that_never_come_are_told(films: dict[str, Path], tmp_path: Path) -> None:
    done = piped(films["h264.mkv"], "convert", "-", tmp_path, "--frames", f"{COUNT}-{COUNT + 2}")
    assert done.returncode == 4
    assert f"frames {COUNT + 1}-{COUNT + 2} did not arrive".encode() in done.stderr
    assert (tmp_path / f"stdin.{COUNT:04d}.exr").exists()


@pytest.mark.parametrize("whole", [1, 2, 5, COUNT - 4])
@pytest.mark.parametrize("more", [1, 6, 500, 1000, 1006])
def test_a_stream_that_breaks_off_is_told(films: dict[str, Path], whole: int, more: int) -> None:
    """Also where what is left of the last frame would divide evenly among those before it."""
    data = films["8.y4m"].read_bytes()
    frame = 96 * 64 * 3 // 2 + len(b"FRAME\n")
    begin = len(data) - COUNT * frame
    read, write = os.pipe()
    feeder = threading.Thread(target=feed, args=(write, data[: begin + whole * frame + more]))
    feeder.start()
    clip = PipeClip(f"/dev/fd/{read}", InputOptions())
    with clip:
        assert [f.index for f in clip.frames()] == list(range(whole))
        assert clip.broken == "the stream breaks off within a frame"
    feeder.join()
    os.close(read)


def feed(end: int, data: bytes) -> None:
    with os.fdopen(end, "wb") as stream:
        stream.write(data)


def test_a_conversion_of_a_stream_that_breaks_off_fails(
    films: dict[str, Path], tmp_path: Path
) -> None:
    data = films["8.y4m"].read_bytes()
    frame = 96 * 64 * 3 // 2 + 6
    cut = data[: len(data) - 3 * frame - 1000]
    done = piped(cut, "convert", "-", tmp_path, "--quiet")
    assert done.returncode == 4, done.stderr
    assert len(list(tmp_path.glob("*.exr"))) in (COUNT - 4, COUNT - 3)


def test_a_stream_that_ends_before_its_stated_duration_is_damaged(
    films: dict[str, Path], tmp_path: Path
) -> None:
    """As a file is, by `preview` as by `convert`."""
    cut = tmp_path / "cut.mkv"
    with av.open(str(films["h264.mkv"])) as box:
        ends = [packet.pos for packet in box.demux(video=0) if packet.size]
    cut.write_bytes(films["h264.mkv"].read_bytes()[: ends[COUNT // 2]])
    for source, output in ((cut, tmp_path / "film.y4m"), ("-", "-")):
        done = piped(cut, "preview", source, output)
        assert done.returncode == 4, done.stderr
        assert b"truncated or damaged" in done.stderr.splitlines()[-2]
    assert done.stdout == (tmp_path / "film.y4m").read_bytes()


def test_a_nut_stream_may_state_the_duration_of_what_it_was_cut_from(tmp_path: Path) -> None:
    """FFmpeg copies the tag, in which Matroska states a track's own duration."""
    for name, keeps in (("cut.nut", True), ("cut.mkv", False)):
        with av.open(str(tmp_path / name), "w") as box:
            stream: Any = box.add_stream("ffv1", rate=24)
            stream.width, stream.height, stream.pix_fmt = 96, 64, "yuv420p"
            stream.metadata["DURATION"] = "00:00:09.000000000"
            for codes in clips.moving_scene(3):
                frame = av.VideoFrame.from_ndarray(codes, "rgb24").reformat(format="yuv420p")
                box.mux(stream.encode(frame))
            box.mux(stream.encode())
        with av.open(str(tmp_path / name)) as made:
            stated = made.streams.video[0].metadata["DURATION"]
        assert (stated == "00:00:09.000000000") == keeps
        with open_clip(tmp_path / name) as clip:
            assert (clip.info.frames, clip.info.frames_cut_off) == (3, 0)


def test_a_reader_that_left_before_the_first_byte_is_a_clean_end(films: dict[str, Path]) -> None:
    """As in `... | true`, whose end of the pipe is closed before there is a header."""
    reading, writing = os.pipe()
    os.close(reading)
    try:
        done = subprocess.run(
            [*command.COMMAND, "preview", str(films["h264.mkv"]), "-"], stdout=writing,
            stderr=subprocess.PIPE, timeout=90, env=command.ENVIRONMENT, check=False,
        )  # fmt: skip
    finally:
        os.close(writing)
    assert done.returncode == 0, done.stderr
    assert b"the reader closed the pipe after 0 frames" in done.stderr


def test_a_reader_that_leaves_is_a_clean_end(films: dict[str, Path]) -> None:
    with (
        films["h264.mkv"].open("rb") as source,
        subprocess.Popen(
            [*command.COMMAND, "preview", "-", "-"], stdin=source, stdout=subprocess.PIPE,
            stderr=subprocess.PIPE, env=command.ENVIRONMENT,
        ) as process,
    ):  # fmt: skip
        assert process.stdout is not None
        assert process.stderr is not None
        assert process.stdout.read(30).startswith(b"YUV4MPEG2 ")
        process.stdout.close()
        told = process.stderr.read().decode()
        assert process.wait(60) == 0, told
    assert "the reader closed the pipe after" in told
    assert "Traceback" not in told


def test_sigterm_ends_a_wait_for_input(films: dict[str, Path]) -> None:
    with subprocess.Popen(
        [*command.COMMAND, "preview", "-", "-"], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL, env=command.ENVIRONMENT,
    ) as process:  # fmt: skip
        assert process.stdin is not None
        assert process.stdout is not None
        # All but the end: the command waits for more.
        process.stdin.write(films["8.y4m"].read_bytes()[:-1])
        process.stdin.flush()
        assert process.stdout.read(10) == b"YUV4MPEG2 "
        drain = threading.Thread(target=process.stdout.read)
        drain.start()
        process.terminate()
        assert process.wait(30) == 143
        drain.join(30)
