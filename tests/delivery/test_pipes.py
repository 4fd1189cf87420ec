"""Pipes: frames that come once are those of the file, bit for bit; all ends are clean ones."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import threading
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import clips
import command
import numpy as np
import pytest

from itmo_video import convert, make_settings, open_clip, read_exr
from itmo_video.delivery.preview import preview
from itmo_video.delivery.preview_options import PreviewOptions
from itmo_video.delivery.y4m import Y4mSpec
from itmo_video.source.pipe import PipeClip
from itmo_video.source.tags import InputOptions

COUNT = 26


def piped(
    data: bytes | Path, *args: object, timeout: float = 90
) -> subprocess.CompletedProcess[bytes]:
    """The command with `data` (or a file's content) through a pipe on standard input."""
    content = data.read_bytes() if isinstance(data, Path) else data
    return subprocess.run(
        [*command.COMMAND, *map(str, args)], input=content, capture_output=True, timeout=timeout,
        env=command.ENVIRONMENT, check=False,
    )  # fmt: skip


def encoded(
    path: Path, codec: str, pixel_format: str, muxer: str | None = None, **tags: int
) -> Path:
    """The moving scene in a codec and container, B frames and all."""
    with av.open(str(path), "w", format=muxer, options={"strict": "-1"}) as box:
        stream: Any = box.add_stream(codec, rate=Fraction(24000, 1001))
        stream.width, stream.height, stream.pix_fmt = 96, 64, pixel_format
        stream.codec_context.thread_count = 1
        for name, value in tags.items():
            setattr(stream.codec_context, name, value)
        for i, codes in enumerate(clips.moving_scene(COUNT, cuts=(11,))):
            frame = av.VideoFrame.from_ndarray(codes, "rgb24").reformat(
                format=pixel_format, dst_colorspace="ITU709"
            )
            frame.pts = i
            for name, value in tags.items():
                setattr(frame, name, value)
            box.mux(stream.encode(frame))
        box.mux(stream.encode())
    return path


KINDS = {
    "h264.mkv": ("libx264", "yuv420p", None),
    "h264.ts": ("libx264", "yuv420p", "mpegts"),
    "ffv1.nut": ("ffv1", "yuv422p10le", None),
    "8.y4m": ("wrapped_avframe", "yuv420p", "yuv4mpegpipe"),
    "10.y4m": ("wrapped_avframe", "yuv420p10le", "yuv4mpegpipe"),
}


@pytest.fixture(scope="module")
def films(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("films")
    return {
        name: encoded(folder / name, codec, form, muxer)
        for name, (codec, form, muxer) in KINDS.items()
    }


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
    films: dict[str, Path], tmp_path: Path, view: str
) -> None:
    source = films["h264.mkv"]
    preview(source, tmp_path / "film.y4m", make_settings(), options=PreviewOptions(view=view))  # type: ignore[arg-type]
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
        preview(films["8.y4m"], path, options=PreviewOptions(view="sdr", depth=depth))  # type: ignore[arg-type]
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
    with PipeClip(f"/dev/fd/{read}", InputOptions()) as clip:
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


def test_what_is_there_is_not_resumed(films: dict[str, Path], tmp_path: Path) -> None:
    for code, more in ((0, ()), (5, ()), (0, ("--overwrite",))):
        done = piped(films["8.y4m"], "convert", "-", tmp_path, "--quiet", "--frames", "1-2", *more)
        assert done.returncode == code, done.stderr


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
    again = piped(films["8.y4m"], "preview", "-", "-")
    assert got == [again.stdout]


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


@pytest.mark.parametrize(
    ("data", "args", "code", "told"),
    [
        (b"", ("convert", "-", "{out}"), 3, "standard input"),
        (b"not a film" * 99, ("convert", "-", "{out}"), 3, "Pipe Y4M"),
        (b"", ("convert", "-", "{out}", "--verify"), 2, "only once"),
        (b"", ("convert", "-", "{out}", "--update"), 2, "--update"),
        (b"", ("convert", "-", "{out}", "--fps", "25"), 2, "resampled"),
        (b"", ("convert", "-", "{out}", "--raw", "yuv420p:1x"), 2, "FORMAT:WIDTHxHEIGHT:FPS"),
        (b"", ("convert", "-", "{out}", "--raw", "nv77:1x1:25"), 2, "FORMAT:WIDTHxHEIGHT:FPS"),
        (
            b"",
            ("preview", "-", "-", "--json"),
            2,
            "--json cannot be used with a film to standard output",
        ),
        (b"", ("preview", "-", "-", "--depth", "8"), 2, "10 bits"),
        (b"", ("preview", "-", "-", "--crf", "20"), 2, "not compressed"),
    ],
)
def test_wrong_use(
    tmp_path: Path, data: bytes, args: tuple[str, ...], code: int, told: str
) -> None:
    done = piped(data, *(a.format(out=tmp_path / "out") for a in args))
    assert done.returncode == code, done.stderr
    assert told in done.stderr.decode()
    assert done.stdout == b""


def test_hdr_through_a_pipe_is_refused(tmp_path: Path) -> None:
    film = encoded(tmp_path / "pq.mkv", "libx265", "yuv420p10le", color_trc=16)
    done = piped(film, "convert", "-", tmp_path / "out")
    assert done.returncode == 6, done.stderr


def test_a_y4m_film_is_no_other_file(films: dict[str, Path], tmp_path: Path) -> None:
    path = tmp_path / "a.y4m"
    path.write_text("mine")
    done = command.run("preview", films["8.y4m"], path, "--overwrite")
    assert done.returncode == 5
    assert path.read_text() == "mine"


CODE = """
import resource, sys
from itmo_video import RunOptions, convert, make_settings
convert('-', 'nowhere', make_settings(), RunOptions(jobs=2, null=True))
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


@pytest.mark.timeout(900)
def test_memory_does_not_grow_with_the_stream(tmp_path: Path) -> None:
    short = clips.write_ffv1(tmp_path / "60.mkv", clips.moving_scene(60, width=192, height=108))
    peaks = []
    for count in (240, 1200):  # with 60 the queues do not fill
        with subprocess.Popen(
            [sys.executable, "-c", FEED, str(short), str(count // 60)], stdout=subprocess.PIPE
        ) as feeder:
            run = subprocess.run(
                [sys.executable, "-c", CODE], stdin=feeder.stdout, capture_output=True, text=True,
                timeout=800, check=True,
            )  # fmt: skip
            assert feeder.wait(30) == 0
        peaks.append(int(run.stdout))
    assert peaks[1] < 1.05 * peaks[0], f"240 frames took {peaks[0]} kB, 1200 {peaks[1]} kB"


FEED = """
import sys, av
with av.open(sys.argv[1]) as box:
    arrays = [f.reformat(format='yuv420p').to_ndarray() for f in box.decode(video=0)]
with av.open(sys.stdout.buffer, 'w', format='yuv4mpegpipe') as out:
    stream = out.add_stream('wrapped_avframe', rate=24)
    stream.width, stream.height, stream.pix_fmt = 192, 108, 'yuv420p'
    for n in range(int(sys.argv[2]) * len(arrays)):
        frame = av.VideoFrame.from_ndarray(arrays[n % len(arrays)], 'yuv420p')
        frame.pts = n
        out.mux(stream.encode(frame))
"""


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
