"""Chroma siting: read where a stream states it, from files and pipes, named where it does not."""

from __future__ import annotations

import subprocess
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import command
import numpy as np
import pytest

from itmo_video import convert, make_settings, open_clip, read_exr
from itmo_video.model import ChromaSiting
from itmo_video.source.chroma_siting import y4m_siting
from itmo_video.source.facts import clip_facts

FFMPEG = "C420jpeg XYSCSS=420JPEG"


def y4m(path: Path, tag: str, bit_depth: int = 8) -> Path:
    """Two frames whose chroma changes from line to line, 32x32."""
    size = 2 if bit_depth > 8 else 1
    codes = np.full((32, 32), 120 << bit_depth - 8), np.zeros((16, 16)), np.full((16, 16), 128)
    codes[1][...] = np.linspace(60, 190, 16)[:, None]
    data = b"".join(plane.astype(f"<u{size}").tobytes() for plane in codes)
    head = f"YUV4MPEG2 W32 H32 F25:1 Ip A1:1 {tag} XCOLORRANGE=LIMITED\n".replace("  ", " ")
    path.write_bytes(head.encode() + (b"FRAME\n" + data) * 2)
    return path


@pytest.mark.parametrize(
    ("tags", "siting", "is_doubtful"),
    [
        ("C420jpeg", "center", False), ("C420mpeg2", "left", False),
        ("C420paldv", "topleft", False), (FFMPEG, "center", True),
        ("C420mpeg2 XYSCSS=420MPEG2", "left", False),
        ("XYSCSS=420PALDV", "topleft", False), ("XYSCSS=420JPEG", "center", False),
        ("C420 XYSCSS=420MPEG2", "left", False), ("C420p10 XYSCSS=420P10", None, False),
        ("C420", None, False), ("", None, False), ("XC420jpeg Ccolour", None, False),
    ],
)  # fmt: skip
def test_y4m_tags(tags: str, siting: ChromaSiting | None, is_doubtful: bool) -> None:
    found, doubt = y4m_siting(f"YUV4MPEG2 W32 H32 {tags} F25:1\nFRAME C420paldv".encode())
    assert found == siting
    assert (doubt is not None) == is_doubtful


@pytest.mark.parametrize(
    ("tag", "bits", "siting", "origin"),
    [
        ("C420jpeg", 8, "center", "tag"), ("C420mpeg2", 8, "left", "tag"),
        ("C420paldv", 8, "topleft", "tag"), ("C420p10", 10, "left", "assumed"),
        ("", 8, "left", "assumed"),
    ],
)  # fmt: skip
def test_y4m_files_and_pipes(
    tmp_path: Path, tag: str, bits: int, siting: ChromaSiting, origin: str
) -> None:
    path = y4m(tmp_path / "clip.y4m", tag, bits)
    with open_clip(path) as clip:
        told = clip_facts(clip.info)
        assert next(iter(clip.frames())).encoding.siting == siting
    assert told["chroma_siting"] == {"value": siting, "from": origin}
    assert ("chroma siting left" in str(told["notices"])) == (origin == "assumed")


def test_a_piped_y4m_has_the_pixels_of_its_file(tmp_path: Path) -> None:
    pixels = []
    for tag in ("C420paldv", FFMPEG):
        path, out = y4m(tmp_path / "clip.y4m", tag), tmp_path / tag[4:8]
        convert(path, out / "file", make_settings(strength=0.0))
        done = subprocess.run(
            [*command.COMMAND, "convert", "-", str(out / "pipe"), "--strength", "0"],
            input=path.read_bytes(), capture_output=True, timeout=90, env=command.ENVIRONMENT,
            check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        assert (b"FFmpeg also writes it" in done.stderr) == (tag == FFMPEG)
        pixels.append(read_exr(out / "file" / "clip.0001.exr").channels["B"])
        assert np.array_equal(pixels[-1], read_exr(out / "pipe" / "stdin.0001.exr").channels["B"])
    assert not np.array_equal(pixels[0], pixels[1]), "the siting shows"


# Without bframes=0, x265 gives a single frame a decoding time by chance (see film_writer.py).
X265 = "log-level=none:bframes=0:chromaloc="


@pytest.mark.parametrize(
    ("codec", "options", "siting"),
    [
        ("libx265", {"x265-params": X265 + "0"}, "left"),
        ("libx265", {"x265-params": X265 + "1"}, "center"),
        ("libx265", {"x265-params": X265 + "2"}, "topleft"),
        ("libx264", {"x264-params": "chromaloc=2"}, "topleft"),
        ("libx264", {}, "left"),  # by the standard, where it is not stated
        ("mpeg2video", {}, "left"), ("mpeg1video", {}, "center"),
    ],
)  # fmt: skip
def test_streams_that_state_it(
    tmp_path: Path, codec: str, options: dict[str, str], siting: ChromaSiting
) -> None:
    path = tmp_path / "clip.mkv"
    with av.open(str(path), "w") as box:
        stream: Any = box.add_stream(codec, rate=Fraction(25), options=options)
        stream.width, stream.height, stream.pix_fmt = 64, 64, "yuv420p"
        frame = av.VideoFrame.from_ndarray(np.full((96, 64), 120, np.uint8), "yuv420p")
        frame.pts = 0
        box.mux(stream.encode(frame))
        box.mux(stream.encode())
    with open_clip(path) as clip:
        assert clip_facts(clip.info)["chroma_siting"] == {"value": siting, "from": "tag"}
