"""Pipes: frames that come once are those of the file, bit for bit."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import threading
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import command
import numpy as np
import pytest
from piping import COUNT, KINDS, piped

from itmo_video import convert, make_settings, read_exr
from itmo_video.delivery.choices import View
from itmo_video.delivery.preview import preview
from itmo_video.delivery.preview_options import PreviewOptions
from itmo_video.delivery.y4m import Y4mSpec


@pytest.mark.parametrize("kind", list(KINDS))
def test_a_piped_clip_is_converted_as_its_file(
    films: dict[str, Path], tmp_path: Path, kind: str
) -> None:
    convert(films[kind], tmp_path / "file", make_settings())
    done = piped(films[kind], "convert", "-", tmp_path / "pipe", "--quiet")
    assert done.returncode == 0, done.stderr
    names = sorted(path.name for path in (tmp_path / "file").glob("*.exr"))
    assert len(names) == COUNT
    for name in names:
        a = read_exr(tmp_path / "file" / name)
        b = read_exr(tmp_path / "pipe" / f"stdin.{name.split('.')[-2]}.exr")
        for channel in "RGB":
            assert np.array_equal(a.channels[channel], b.channels[channel]), name
        assert a.attributes["itmoTime"] == b.attributes["itmoTime"]
        assert a.attributes["framesPerSecond"] == b.attributes["framesPerSecond"]


@pytest.mark.parametrize("view", ["hdr10", "hlg", "sdr"])
def test_pipe_to_pipe_gives_the_films_frames(
    films: dict[str, Path], tmp_path: Path, view: View
) -> None:
    source = films["h264.mkv"]
    preview(source, tmp_path / "film.y4m", make_settings(), options=PreviewOptions(view=view))
    done = piped(source, "preview", "-", "-", "--as", view)
    assert done.returncode == 0, done.stderr
    assert done.stdout == (tmp_path / "film.y4m").read_bytes()
    assert (b"MaxCLL" in done.stderr) == (view != "sdr")


def test_ffmpeg_reads_what_was_meant(films: dict[str, Path], tmp_path: Path) -> None:
    probe = shutil.which("ffprobe")
    if probe is None:
        pytest.skip("ffprobe is not installed")
    for depth, chroma, pixel_format in (
        ("10", "420", "yuv420p10le"), ("10", "422", "yuv422p10le"), ("8", "420", "yuv420p"),
    ):  # fmt: skip
        path = tmp_path / f"{depth}{chroma}.y4m"
        done = command.run("preview", films["h264.mkv"], path, "--as", "sdr", "--depth", depth,
                           "--chroma", chroma)  # fmt: skip
        assert done.returncode == 0, done.stderr
        told = subprocess.run(
            [probe, "-v", "error", "-count_frames", "-show_entries",
             "stream=pix_fmt,width,height,r_frame_rate,nb_read_frames,color_range",
             "-of", "default=nw=1", str(path)],
            capture_output=True, text=True, check=True,
        ).stdout  # fmt: skip
        wanted = {
            "pix_fmt": pixel_format, "width": "96", "height": "64", "color_range": "tv",
            "r_frame_rate": "24000/1001", "nb_read_frames": str(COUNT),
        }  # fmt: skip
        assert dict(line.split("=") for line in told.split()) == wanted


def test_eight_bits_are_ten_bits_rounded(films: dict[str, Path], tmp_path: Path) -> None:
    planes = {}
    for depth in ("8", "10"):
        path = tmp_path / f"{depth}.y4m"
        preview(films["8.y4m"], path, options=PreviewOptions(view="sdr", depth=depth))
        with av.open(str(path)) as box:
            frame = next(box.decode(video=0))
            kind = np.uint8 if depth == "8" else np.uint16
            rows = np.frombuffer(memoryview(frame.planes[0]), kind).reshape(64, -1)[:, :96]
            planes[depth] = rows.astype(float)
    assert np.abs(planes["8"] - planes["10"] / 4).max() <= 1.26
    assert abs((planes["8"] - planes["10"] / 4).mean()) < 0.02


def test_the_header_of_a_stream() -> None:
    spec = Y4mSpec(1920, 1080, Fraction(24000, 1001), Fraction(64, 45))
    assert spec.header() == (
        b"YUV4MPEG2 W1920 H1080 F24000:1001 Ip A64:45 C420p10 XYSCSS=420P10 XCOLORRANGE=LIMITED\n"
    )


def test_ranges_of_a_pipe_give_the_same_frames(films: dict[str, Path], tmp_path: Path) -> None:
    convert(films["h264.mkv"], tmp_path / "file", make_settings())
    done = piped(films["h264.mkv"], "convert", "-", tmp_path / "pipe", "--frames", "3,12-14,25")
    assert done.returncode == 0, done.stderr
    found = sorted(path.name for path in (tmp_path / "pipe").glob("*.exr"))
    assert [int(name.split(".")[1]) for name in found] == [3, 12, 13, 14, 25]
    for name in found:
        a = read_exr(tmp_path / "file" / name.replace("stdin", "h264"))
        assert np.array_equal(a.channels["G"], read_exr(tmp_path / "pipe" / name).channels["G"]), (
            name
        )


def test_fifos_and_raw_frames(films: dict[str, Path], tmp_path: Path) -> None:
    with av.open(str(films["8.y4m"])) as box:
        raw = b"".join(
            np.frombuffer(memoryview(plane), np.uint8)
            .reshape(plane.height, -1)[:, : plane.width].tobytes()
            for frame in box.decode(video=0) for plane in frame.planes
        )  # fmt: skip
    source, film = tmp_path / "in.fifo", tmp_path / "out.fifo"
    os.mkfifo(source)
    os.mkfifo(film)
    feeder = threading.Thread(target=source.write_bytes, args=(raw,))
    got: list[bytes] = []
    reader = threading.Thread(target=lambda: got.append(film.read_bytes()))
    for thread in (feeder, reader):
        thread.start()
    done = command.run("preview", source, film, "--raw", "yuv420p:96x64:24000/1001")
    for thread in (feeder, reader):
        thread.join(30)
    assert done.returncode == 0, done.stderr
    # Raw frames state no siting, and left is assumed.
    left = films["8.y4m"].read_bytes().replace(b"C420jpeg XYSCSS=420JPEG", b"C420mpeg2", 1)
    again = piped(left, "preview", "-", "-")
    assert got == [again.stdout]


@pytest.mark.parametrize(
    "encoder",
    [
        ("x265", "--y4m", "-", "--output-depth", "10", "--log-level", "error", "-o", "{film}"),
        ("SvtAv1EncApp", "-i", "stdin", "--preset", "10", "-b", "{film}"),
    ],
    ids=["x265", "svt"],
)
def test_encoders_take_it(films: dict[str, Path], tmp_path: Path, encoder: tuple[str, ...]) -> None:
    if shutil.which(encoder[0]) is None:
        pytest.skip(f"{encoder[0]} is not installed")
    film = tmp_path / ("film.hevc" if encoder[0] == "x265" else "film.ivf")
    stream = piped(films["h264.mkv"], "preview", "-", "-").stdout
    done = subprocess.run(
        [part.format(film=film) for part in encoder], input=stream, capture_output=True,
        timeout=120, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    with av.open(str(film)) as box:
        frames = list(box.decode(video=0))
    assert len(frames) == COUNT
    assert frames[0].format.name == "yuv420p10le"
    assert not re.search(b"WARN|error", done.stderr.replace(b"Error: 0", b""), re.I), done.stderr


def fed(data: bytes, *args: str) -> subprocess.CompletedProcess[bytes]:
    """The command, with `data` as its standard input."""
    return subprocess.run(
        [*command.COMMAND, *args], input=data, capture_output=True, timeout=90,
        env=command.ENVIRONMENT, check=False,
    )  # fmt: skip


def test_raw_frames_of_another_size_are_told(tmp_path: Path) -> None:
    """Not only in part: whoever gives 95 lines for 96 gets skewed pictures before the end."""
    out = str(tmp_path / "out")
    done = fed(bytes(96 * 64 * 2), "convert", "-", out, "--raw", "gray:96x63:24")
    assert done.returncode == 4
    assert b"no whole number of 96x63 frames: is --raw right?" in done.stderr
    assert b"What came before was converted: 2 frames." in done.stderr


@pytest.mark.parametrize(("gap", "told"), [(40, False), (120, True)])
def test_times_that_y4m_cannot_hold_are_told(tmp_path: Path, gap: int, told: bool) -> None:
    film = tmp_path / "clip.mkv"
    with av.open(str(film), "w") as box:
        stream: Any = box.add_stream("ffv1", rate=25)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        stream.time_base = Fraction(1, 1000)
        for pts in (0, 40, 80, 80 + gap, 120 + gap):
            frame = av.VideoFrame.from_ndarray(np.full((72, 64), 90, np.uint8), "yuv420p")
            frame.pts, frame.time_base = pts, Fraction(1, 1000)
            box.mux(stream.encode(frame))
        box.mux(stream.encode())
    for source in (str(film), "-"):
        given = film.read_bytes() if source == "-" else b""
        done = fed(given, "preview", source, "-")
        assert done.returncode == 0, done.stderr
        assert (b"Y4M has one frame rate" in done.stderr) == told, source
