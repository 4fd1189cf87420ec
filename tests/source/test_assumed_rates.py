"""Sources that state no frame rate get the same one everywhere, and a notice says so."""

from __future__ import annotations

import os
import threading
from fractions import Fraction
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from clips import moving_scene, write_ffv1
from source_clips import write_scene

from itmo_video import RunOptions, convert, make_settings, open_clip, preview
from itmo_video.evaluation.agreement import TEST, Display
from itmo_video.evaluation.films import films
from itmo_video.events import Event, Warned
from itmo_video.source.pipe import PipeClip, is_pipe
from itmo_video.source.tags import InputOptions

NONE_STATED = "no frame rate is stated: assumed 25 fps"


def y4m(path: Path, rate: str) -> Path:
    head = f"YUV4MPEG2 W64 H48 {rate}Ip A1:1 C420mpeg2\n".encode()
    path.write_bytes(head + 2 * (b"FRAME\n" + bytes([99]) * (64 * 48 * 3 // 2)))
    return path


def raw_hevc(path: Path, params: str) -> Path:
    """A stream without a container, which states its rate in the VUI only."""
    return write_scene(
        path, "libx265", 3, options={"x265-params": f"log-level=none:bframes=0:{params}"}
    )


def rate_of(source: Path) -> tuple[float, bool]:
    """The rate, and whether it is said to be assumed."""
    with PipeClip(source, InputOptions()) if is_pipe(source) else open_clip(source) as clip:
        said = [notice for notice in clip.info.notices if NONE_STATED in notice]
        return float(clip.info.frame_rate), bool(said)


def fed(source: Path, fifo: Path) -> Path:
    """A FIFO that is written to with the file's bytes."""
    os.mkfifo(fifo)
    threading.Thread(target=lambda: fifo.write_bytes(source.read_bytes()), daemon=True).start()
    return fifo


@pytest.mark.parametrize(
    ("params", "expected"),
    [
        ("vui-timing-info=0", (25, True)),
        ("vui-timing-info=1", (25, False)),
        ("vui-timing-info=1:fps=50", (50, False)),
    ],
)
def test_a_raw_stream_has_the_rate_that_it_states(
    tmp_path: Path, params: str, expected: tuple[float, bool]
) -> None:
    path = raw_hevc(tmp_path / "a.hevc", params)
    assert rate_of(path) == expected
    assert rate_of(fed(path, tmp_path / "fifo")) == expected
    with open_clip(path) as clip:
        assert clip.time_s(2) == Fraction(2) / int(expected[0])


@pytest.mark.parametrize(
    ("field", "expected"),
    [("", (25, True)), ("F0:0 ", (25, True)), ("F25:1 ", (25, False)), ("F50:1 ", (50, False))],
)
def test_y4m_may_state_no_rate(tmp_path: Path, field: str, expected: tuple[float, bool]) -> None:
    path = y4m(tmp_path / "a.y4m", field)
    assert rate_of(path) == expected
    assert rate_of(fed(path, tmp_path / "fifo")) == expected


def test_a_container_with_one_frame_states_its_rate(tmp_path: Path) -> None:
    path = write_ffv1(tmp_path / "one.mkv", moving_scene(1), fps=30)
    assert rate_of(path) == (30, False)


def test_a_folder_without_rates_is_a_sequence_for_all_commands(tmp_path: Path) -> None:
    out = tmp_path / "out"
    convert(write_ffv1(tmp_path / "c.mkv", moving_scene(2), fps=50), out, make_settings())
    for path in out.glob("*.exr"):
        with OpenEXR.File(str(path)) as file:
            header, pixels = dict(file.header()), np.array(file.channels()["RGB"].pixels)
        del header["framesPerSecond"], header["itmoTime"]
        OpenEXR.File(header, {"RGB": pixels}).write(str(path))
    told: list[Event] = []
    preview(out, tmp_path / "film.mp4", run=RunOptions(jobs=1), on_event=told.append)
    with open_clip(tmp_path / "film.mp4", InputOptions(force_sdr=True)) as film:
        assert film.info.frame_rate == 24
    measured: list[Event] = []
    assert films(out, out, None, Display(), on_event=measured.append)[TEST].frame_rate == 24
    notice = Warned("the EXR files state no frame rate: assumed 24 fps")
    assert notice in told
    assert measured == [notice]
