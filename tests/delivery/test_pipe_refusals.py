"""Pipes that are refused, with the reason: wrong use, HDR, files that are not ours."""

from __future__ import annotations

from pathlib import Path

import command
import pytest
from piping import encoded, piped


def test_what_is_there_is_not_resumed(films: dict[str, Path], tmp_path: Path) -> None:
    for code, more in ((0, ()), (5, ()), (0, ("--overwrite",))):
        done = piped(films["8.y4m"], "convert", "-", tmp_path, "--quiet", "--frames", "1-2", *more)
        assert done.returncode == code, done.stderr


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
