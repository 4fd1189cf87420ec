"""Damaged source frames are told by every command that uses them, not by `convert` alone."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from clips import moving_scene, write_noise

from itmo_video.cli.main import main


@pytest.fixture(scope="module")
def damaged(tmp_path_factory: pytest.TempPathFactory) -> Path:
    clip = write_noise(tmp_path_factory.mktemp("clip") / "a.avi", "mpeg4", 12, seed=3)
    data = bytearray(clip.read_bytes())
    at = data.index(b"movi") + (len(data) - data.index(b"movi")) // 2
    data[at : at + 400] = np.random.default_rng(4).bytes(400)
    clip.write_bytes(data)
    return clip


@pytest.fixture
def numbers(damaged: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> str:
    """The damaged frames, as `convert` names them; the folder is tmp_path / "out"."""
    assert main(["convert", str(damaged), str(tmp_path / "out"), "--quiet"]) == 4
    (told,) = re.findall(r"frames (\S+) are damaged in the source", capsys.readouterr().err)
    return str(told)


@pytest.mark.parametrize("kind", ["a film", "a still", "a folder"])
def test_preview(
    kind: str, damaged: Path, numbers: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = tmp_path / "out" if kind == "a folder" else damaged
    film = tmp_path / ("still.png" if kind == "a still" else "film.y4m")
    first = re.split("[-,]", numbers)[0]
    flags = ["--frame", first] if kind == "a still" else []
    assert main(["preview", str(source), str(film), "--quiet", *flags]) == 4
    told = f"frame {first} is" if kind == "a still" else f"frames {numbers} are"
    assert f"{told} damaged in the source" in capsys.readouterr().err
    assert film.stat().st_size > 0, "what there is, is shown"


def test_verify_analyse_and_light_levels(
    damaged: Path, numbers: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = str(tmp_path / "out")
    assert main(["convert", str(damaged), out, "--verify"]) == 0, "the folder is as it should be"
    told = capsys.readouterr()
    assert f"frames {numbers} are damaged in the source" in told.err
    assert "all frames are present and intact" in told.out
    assert main(["analyse", str(damaged), "--hdr10"]) == 0
    assert f"frames {numbers} are damaged in the source" in capsys.readouterr().err
    assert main(["analyse", str(damaged), "--output", str(tmp_path / "a.json")]) == 0
    first = re.split("[-,]", numbers)[0]
    assert f"from frame {first} on: damaged in the source" in capsys.readouterr().err
    (tmp_path / "out" / "a.0001.exr").unlink()
    assert main(["convert", str(damaged), out, "--verify"]) == 7, "what is wrong here comes first"


@pytest.mark.parametrize(
    ("line", "told"),
    [
        (("analyse", "{clip}", "--hdr10plus", "{x}", "--dolby-vision", "{x}"), "the same file"),
        (("preview", "{clip}", "{x}.png", "--frame", "2", "--frames", "2-3"), "cannot be combined"),
    ],
)
def test_what_would_be_lost_is_refused(
    line: tuple[str, ...], told: str, damaged: Path, tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    assert main([part.format(clip=damaged, x=tmp_path / "x") for part in line]) == 2
    assert told in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no FIFOs here")
def test_a_still_to_a_pipe(
    damaged: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    os.mkfifo(tmp_path / "o.png")
    assert main(["preview", str(damaged), str(tmp_path / "o.png"), "--frame", "2"]) == 2
    assert "a still cannot go to a pipe" in capsys.readouterr().err


def test_verify_tells_what_the_source_lacks(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    clip = tmp_path / "a.mp4"
    with av.open(str(clip), "w", options={"movflags": "faststart"}) as box:
        stream: Any = box.add_stream("mpeg4", rate=25)
        stream.width, stream.height, stream.pix_fmt, stream.gop_size = 64, 48, "yuv420p", 1
        for codes in moving_scene(12, width=64, height=48):
            box.mux(stream.encode(av.VideoFrame.from_ndarray(codes, "rgb24")))
        box.mux(stream.encode())
    data = clip.read_bytes()
    clip.write_bytes(data[: len(data) * 3 // 4])
    assert main(["convert", str(clip), str(tmp_path / "out"), "--quiet"]) == 4
    capsys.readouterr()
    assert main(["convert", str(clip), str(tmp_path / "out"), "--verify"]) == 0
    told = capsys.readouterr().err
    assert re.search(r"the source is truncated or damaged: \d frames are missing", told), told
