"""JSON, TOML, numbers and files that others made: an error, at once, and in bounds."""

from __future__ import annotations

import io
import json
import os
import resource
import shutil
from collections.abc import Callable
from contextlib import redirect_stderr
from fractions import Fraction
from pathlib import Path

import pytest
from clips import SHARED, moving_scene, write_ffv1

from itmo_video import make_settings
from itmo_video.cli.main import main
from itmo_video.errors import InputError, UsageError
from itmo_video.regular_file import read_regular
from itmo_video.untrusted import parse_json, parse_rational, read_json, read_toml

FAULTS = SHARED / "data/fault_files"


def terabytes(path: Path) -> None:
    path.touch()
    os.truncate(path, 1 << 42)


HOSTILE: dict[str, Callable[[Path], object]] = {
    "fifo": lambda path: os.mkfifo(path),
    "zero": lambda path: path.symlink_to("/dev/zero"),
    "null": lambda path: path.symlink_to("/dev/null"),
    "folder": lambda path: path.mkdir(),
    "loop": lambda path: path.symlink_to(path.name),
    "terabytes": terabytes,
    "deep": lambda path: path.write_text("[" * 100_000),
    "deep tables": lambda path: path.write_text('{"a":' * 100_000),
    "noise": lambda path: path.write_bytes(os.urandom(999)),
    "empty": lambda path: path.touch(),
    "digits": lambda path: path.write_text('{"format": ' + "9" * 10_000 + "}"),
    "infinite": lambda path: path.write_text('{"format": 1e999999999}'),
    "nan": lambda path: path.write_text('{"format": NaN}'),
    "utf-16": lambda path: path.write_text('{"format": 2}', "utf-16"),
}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    top = tmp_path_factory.mktemp("made")
    clip = write_ffv1(top / "c.mkv", moving_scene(2, width=64, height=48))
    assert main(["convert", str(clip), str(top / "o"), "--quiet"]) == 0
    return top


def refused(*line: object) -> None:
    """A word of one or two lines, exit code 2, 3, 5 or 7, and no gigabytes."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    told = io.StringIO()
    with redirect_stderr(told):
        code = main([*map(str, line)])
    assert code in (2, 3, 5, 7), told.getvalue()
    assert len(told.getvalue().splitlines()) <= 3, told.getvalue()
    assert "unexpected" not in told.getvalue()
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 600_000


@pytest.mark.parametrize("kind", HOSTILE)
def test_read_with_care(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "file"
    HOSTILE[kind](path)
    with pytest.raises(InputError):
        read_json(path)
    if kind not in ("empty", "null"):  # empty TOML is TOML
        with pytest.raises(InputError):
            read_toml(path)


@pytest.mark.parametrize("kind", ["fifo", "terabytes", "deep", "noise"])
def test_every_way_in(kind: str, made: Path, tmp_path: Path) -> None:
    path = tmp_path / "file.toml"
    HOSTILE[kind](path)
    clip = made / "c.mkv"
    if kind != "fifo":  # as a source it is a pipe, and waits for who writes
        refused("convert", path, tmp_path / "new")
        refused("info", path)
    refused("convert", clip, tmp_path / "new", "--analysis", path)
    refused("convert", clip, tmp_path / "new", "--preset", path)
    refused("evaluate", made / "o", "--source", clip, "--motion", path)
    copy = tmp_path / "copy"
    shutil.copytree(made / "o", copy)
    for name in ("c.0001.exr", "itmo-video.json"):
        kept = (copy / name).read_bytes()
        (copy / name).unlink()
        HOSTILE[kind](copy / name)
        refused("preview", copy, tmp_path / "film.mp4")
        refused("report", copy)
        refused("convert", clip, copy, "--verify")
        (copy / name).unlink()
        (copy / name).write_bytes(kept)


@pytest.mark.parametrize(
    ("text", "value"),
    [("25", Fraction(25)), (" 24000/1001 ", Fraction(24000, 1001)), ("23.976", Fraction("23.976")),
     ("-0.5", Fraction(-1, 2)), ("1/-2", None), ("1e9", None), ("1e999999999", None), ("inf", None),
     ("nan", None), ("1/0", None), ("9" * 30, None), ("", None), ("1_000", None), ("٣", None)],
)  # fmt: skip
def test_rationals(text: str, value: Fraction | None) -> None:
    if value is None:
        with pytest.raises(ValueError, match="not a number"):
            parse_rational(text)
    else:
        assert parse_rational(text) == value


@pytest.mark.parametrize("text", ["1e400", "-1e400", "NaN", "Infinity", "[" * 65 + "]" * 65])
def test_json_beyond_bounds(text: str) -> None:
    with pytest.raises(ValueError, match=r"large|number|deep"):
        parse_json(text)
    assert parse_json(json.dumps({"a": [1, 2.5]})) == {"a": [1, 2.5]}


def test_a_rate_of_a_thousand_million_digits() -> None:
    with pytest.raises(UsageError, match="fps"):
        make_settings(fps="1e999999999")


def test_at_most_so_many_bytes(tmp_path: Path) -> None:
    (tmp_path / "f").write_bytes(b"12345")
    assert read_regular(tmp_path / "f", 5) == b"12345"
    with pytest.raises(InputError, match="more than the limit of 4"):
        read_regular(tmp_path / "f", 4)


@pytest.mark.skipif(not FAULTS.exists(), reason="needs ../shared")
def test_shared_faults(tmp_path: Path) -> None:
    refused("convert", FAULTS / "s.mp4", tmp_path, "--analysis", FAULTS / "an_exp.json")
    refused("convert", FAULTS / "source_playlist.m3u8", tmp_path)
    assert main(["info", str(FAULTS / "d_exp.mkv")]) in (0, 3)
    copy = tmp_path / "rational0"
    shutil.copytree(FAULTS / "rational0", copy)
    assert main(["preview", str(copy), str(tmp_path / "a.mp4")]) in (3, 4)
    assert main(["report", str(copy)]) in (3, 4)


def test_an_avi_that_counts_more_chunks_than_it_has_room_for(tmp_path: Path) -> None:
    """A number in its header took the memory of two thousand million frames."""
    path = write_ffv1(tmp_path / "a.avi", moving_scene(4, width=64, height=48))
    data = bytearray(path.read_bytes())
    for mark, at in ((b"avih", 8 + 16), (b"strh", 8 + 32)):  # frames in all, of the stream
        begin = data.index(mark) + at
        data[begin : begin + 4] = (2**31 - 1).to_bytes(4, "little")
    path.write_bytes(data)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert main(["convert", str(path), str(tmp_path / "o"), "--quiet"]) in (0, 4)
    assert len(list((tmp_path / "o").glob("*.exr"))) >= 4
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 600_000
