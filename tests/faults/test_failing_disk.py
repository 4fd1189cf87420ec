"""A disk that fails in mid-file (EIO): what came before is written, the place is named, never 0."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from clips import exr_bytes, moving_scene
from command import COMMAND, ENVIRONMENT
from PIL import Image

from itmo_video.regular_file import open_regular
from itmo_video.source import remembered

sys.path.insert(0, str(Path(__file__).parent))

from codec_clips import make_clip

from itmo_video.cli.main import main
from itmo_video.source import digest
from itmo_video.source.read_faults import ReadFault

pytestmark = pytest.mark.skipif(
    not sys.platform.startswith("linux") or shutil.which("gcc") is None,
    reason="no way here to make a disk that fails",
)
FAST = ("--quiet", "--lights", "16", "--no-expand-map")
TOLD = "reading fails at byte {} (Input/output error)"
Run = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Runs the command on a disk where reading `path` fails from byte `at` on.

    After it has been begun `after` times: to open a film takes a few.
    """
    library = tmp_path_factory.mktemp("disk") / "failing_disk.so"
    source = Path(__file__).parent / "failing_disk.c"
    subprocess.run(["gcc", "-shared", "-fPIC", "-o", library, source, "-ldl"], check=True)

    def run(path: Path, at: int, *line: object, after: int = 0) -> subprocess.CompletedProcess[str]:
        disk = {"FAILING_PATH": str(path), "FAILING_AT": str(at), "FAILING_AFTER": str(after)}
        done = subprocess.run(
            [*COMMAND, *map(str, line)],
            env={**ENVIRONMENT, "LD_PRELOAD": str(library), **disk},
            capture_output=True, text=True, timeout=100, check=False,
        )  # fmt: skip
        assert "unexpected" not in done.stderr
        assert "Traceback" not in done.stderr
        return done

    return run


def y4m(folder: Path) -> Path:
    path = folder / "y4m.y4m"
    with av.open(str(path), "w") as box:
        stream = box.add_stream("wrapped_avframe", rate=Fraction(24))
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        for n, codes in enumerate(moving_scene(60, width=64, height=48)):
            frame = av.VideoFrame.from_ndarray(codes, "rgb24").reformat(format="yuv420p")
            frame.pts = n
            box.mux(stream.encode(frame))
        box.mux(stream.encode())
    return path


def index_first(path: Path) -> Path:
    """The film with its index before its frames, as for streaming: else it is lost with the end."""
    with av.open(str(path)) as source:
        first = path.with_name(f"first{path.suffix}")
        with av.open(str(first), "w", options={"movflags": "faststart"}) as box:
            stream = source.streams.video[0]
            copy = box.add_stream_from_template(stream)
            for packet in source.demux(stream):
                if packet.dts is not None:
                    packet.stream = copy
                    box.mux(packet)
    return first


@pytest.mark.parametrize(
    "codec", ["h264", "prores", "h264mkv", "h264ts", "h264avi", "vp9", "wmv2", "mpeg2", "y4m"]
)
def test_what_came_before_is_written(codec: str, run: Run, tmp_path: Path) -> None:
    clip = y4m(tmp_path) if codec == "y4m" else make_clip(codec, tmp_path, size=(64, 48))
    if clip.suffix in (".mp4", ".mov"):
        clip = index_first(clip)
    half = clip.stat().st_size // 2
    done = run(clip, half, "convert", clip, tmp_path / "o", *FAST)
    assert done.returncode == 4, done.stderr
    assert TOLD.format(half) in done.stderr
    assert str(clip) in done.stderr
    assert 10 < len(exr_bytes(tmp_path / "o")) < 50, "half of it could be read"


@pytest.mark.parametrize("codec", ["h264ts", "h264mkv"])
def test_a_disk_that_fails_while_frames_are_made(codec: str, run: Run, tmp_path: Path) -> None:
    """What is written then is what the whole film has: the same command goes on later."""
    clip = make_clip(codec, tmp_path, size=(64, 48))
    assert main(["convert", str(clip), str(tmp_path / "whole"), *FAST]) == 0
    whole, half = exr_bytes(tmp_path / "whole"), clip.stat().st_size // 2
    for after in range(8, 3, -1):  # as late as it can be: when it was opened and hashed
        shutil.rmtree(tmp_path / "o", ignore_errors=True)
        done = run(clip, half, "convert", clip, tmp_path / "o", *FAST, after=after)
        if done.returncode:
            break
    assert done.returncode == 4, done.stderr
    assert "reading fails at byte" in done.stderr
    assert 0 < len(exr_bytes(tmp_path / "o")) < 60
    assert exr_bytes(tmp_path / "o").items() < whole.items()
    assert main(["convert", str(clip), str(tmp_path / "o"), *FAST]) == 0
    assert exr_bytes(tmp_path / "o") == whole


def test_commands_tell(run: Run, tmp_path: Path) -> None:
    clip = make_clip("h264ts", tmp_path, size=(64, 48))
    folder, half = tmp_path / "o", clip.stat().st_size // 2
    assert main(["convert", str(clip), str(folder), *FAST, "--frames", "1-8"]) == 0
    film, page = tmp_path / "a.y4m", tmp_path / "page.html"
    for code, *line in (
        (4, "preview", clip, film, "--quiet"),
        (4, "analyse", clip, "--output", tmp_path / "a.json"),
        (3, "evaluate", folder, "--source", clip),
        (3, "report", folder, "--source", clip, "--output", page),
        (0, "info", clip),
        (0, "convert", clip, tmp_path / "range", "--frames", "1-4"),
    ):
        done = run(clip, half, *line)
        assert done.returncode == code, (line, done.stderr)
        assert TOLD.format(half) in done.stdout + done.stderr, line
    assert film.exists()
    assert not (tmp_path / "a.json").exists(), "an analysis of a film that nobody has"
    assert not page.exists()


def test_a_hash_that_was_remembered_is_not_trusted_on_a_disk_that_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clip = make_clip("h264ts", tmp_path, size=(64, 48))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(digest, "_WORTH_REMEMBERING", 1)
    monkeypatch.setattr(digest, "_SETTLED_S", -1.0)
    known = digest.file_digest(clip, scanned_bytes=0)
    monkeypatch.setattr(digest, "find_fault", lambda path, start, most: ReadFault(start, "gone"))
    monkeypatch.setattr(remembered, "remember", lambda *args: None)
    hashed: list[Path] = []

    def counted(path: Path) -> Any:
        hashed.append(path)
        return open_regular(path)

    monkeypatch.setattr(digest, "open_regular", counted)
    assert (digest.file_digest(clip), hashed) == (known, [])
    assert (digest.file_digest(clip, scanned_bytes=7), hashed) == (known, [clip])


def test_a_film_whose_index_is_lost(run: Run, tmp_path: Path) -> None:
    clip = make_clip("h264", tmp_path, size=(64, 48))  # its index is at its end
    done = run(clip, clip.stat().st_size // 2, "convert", clip, tmp_path / "o", *FAST)
    assert done.returncode == 3
    assert TOLD.format(clip.stat().st_size // 2) in done.stderr


@pytest.mark.parametrize("suffix", ["png", "jpg", "tif"])
def test_an_image_of_a_sequence(suffix: str, run: Run, tmp_path: Path) -> None:
    for n, codes in enumerate(moving_scene(3, width=64, height=48)):
        Image.fromarray(np.asarray(codes)).save(tmp_path / f"s.{n + 1:04d}.{suffix}")
    image = tmp_path / f"s.0002.{suffix}"
    sequence = tmp_path / f"s.%04d.{suffix}"
    half = image.stat().st_size // 2
    done = run(image, half, "convert", sequence, tmp_path / "o", *FAST)
    assert done.returncode == 4, done.stderr
    assert f"frame 2 is missing or cannot be decoded ({image.name}: cannot be read" in done.stderr
    assert len(exr_bytes(tmp_path / "o")) == 2
    if suffix == "png":  # alone, there is nothing that came before
        assert run(image, 0, "convert", image, tmp_path / "alone", *FAST).returncode == 3


def test_a_frame_of_a_folder(run: Run, tmp_path: Path) -> None:
    clip = make_clip("ffv1", tmp_path, frames=3, size=(64, 48))
    folder = tmp_path / "o"
    assert main(["convert", str(clip), str(folder), *FAST]) == 0
    frame = sorted(folder.glob("*.exr"))[1]
    before, half = frame.read_bytes(), frame.stat().st_size // 2
    for code, *line in (
        (7, "convert", clip, folder, *FAST, "--verify"),
        (3, "preview", folder, tmp_path / "a.y4m"),
        (3, "report", folder, "--output", tmp_path / "page.html"),
        (3, "evaluate", folder, "--source", clip),
    ):
        done = run(frame, half, *line)
        assert (done.returncode, frame.name in done.stderr) == (code, True), done.stderr
    assert frame.read_bytes() == before
    assert os.listdir(tmp_path / "o").count(frame.name) == 1
