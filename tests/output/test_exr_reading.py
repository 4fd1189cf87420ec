"""EXR files read: which are whole, and those of other programs."""

from __future__ import annotations

import sys
import types
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from exr_pictures import HEADER, header, is_whole, picture

from itmo_video.compressions import WRITTEN as COMPRESSIONS
from itmo_video.errors import InputError
from itmo_video.output import exr

pytestmark = pytest.mark.usefixtures("loops")


# What is not whole


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_cut_files_are_not_whole_and_quiet(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], compression: str
) -> None:
    path = tmp_path / "a.exr"
    exr.write_exr(path, picture(70, 60), header(compression=compression))
    data = path.read_bytes()
    cuts = {0, 1, 3, 4, 8, 9, 50, 400, len(data) // 2, len(data) - 9, len(data) - 1}
    for cut in sorted(cuts | set(range(100, len(data), len(data) // 20))):
        path.write_bytes(data[:cut])
        with pytest.raises(InputError) as caught:
            exr.read_exr(path)
        assert caught.value.where == str(path)
    assert capfd.readouterr() == ("", "")
    path.write_bytes(data)
    assert is_whole(path)


def test_files_with_holes_are_not_whole(tmp_path: Path) -> None:
    """A machine that dies may leave a file of full length and zeros from somewhere on."""
    path = tmp_path / "a.exr"
    exr.write_exr(path, picture(70, 60), HEADER)
    data = path.read_bytes()
    for start in range(0, len(data), len(data) // 30):
        path.write_bytes(data[:start] + bytes(len(data) - start))
        assert not is_whole(path), start


def test_rotten_pixels_stay_out_of_standard_output(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, whole = tmp_path / "a.exr", tmp_path / "whole.exr"
    exr.write_exr(path, picture(70, 60), HEADER)
    exr.write_exr(whole, picture(70, 60), HEADER)
    data = bytearray(path.read_bytes())
    data[-100] ^= 1
    path.write_bytes(data)
    seen = []

    class Watched(types.ModuleType):
        def __setattr__(self, name: str, value: object) -> None:
            seen.append(name)
            super().__setattr__(name, value)

    kind = type(sys)
    sys.__class__ = Watched
    try:
        assert not is_whole(path)
        assert exr.read_exr(whole).channels["R"].flags.writeable
    finally:
        sys.__class__ = kind
    print("after")
    assert capsys.readouterr().out == "after\n"
    assert "stdout" not in seen, "the whole process's standard output was swapped"


def test_other_files_are_not_whole(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    for name, data in (("t.exr", b"hello" * 100), ("j.exr", b"\xff\xd8\xff" * 40)):
        (tmp_path / name).write_bytes(data)
        assert not is_whole(tmp_path / name)
    for path in (tmp_path / "missing.exr", tmp_path):
        with pytest.raises(InputError, match=r"no such file|not a regular"):
            exr.read_exr(path)
    assert capfd.readouterr() == ("", "")


def test_fingerprint_behind_long_settings(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    exr.write_exr(path, picture(70, 60), header(settings_text="x" * 200_000))
    assert exr.read_exr(path).fingerprint == HEADER.fingerprint


@pytest.mark.parametrize("compression", ["NO", "ZIP", "PIZ", "B44A", "HTJ2K32", "ZSTD"])
def test_other_peoples_files_are_read(tmp_path: Path, compression: str) -> None:
    """Float pixels, an offset data window, lines from the bottom up; no attributes of ours."""
    path = str(tmp_path / "theirs.exr")
    pixels = np.random.default_rng(0).random((50, 40, 3)).astype(np.float32)
    attributes = {
        "compression": getattr(OpenEXR, f"{compression}_COMPRESSION"),
        "type": OpenEXR.scanlineimage,
        "lineOrder": OpenEXR.DECREASING_Y,
        "dataWindow": (np.array([5, -7], np.int32), np.array([44, 42], np.int32)),
    }
    OpenEXR.File(attributes, {"RGB": pixels}).write(path)
    image = exr.read_exr(path)
    assert image.size == (40, 50)
    assert image.fingerprint is None
    assert np.array_equal(image.channels["G"], pixels[..., 1])


def test_tiled_files_are_read(tmp_path: Path) -> None:
    path = str(tmp_path / "tiled.exr")
    tiles = OpenEXR.TileDescription()
    tiles.xSize = tiles.ySize = 32
    pixels = np.ones((50, 40), np.float16)
    OpenEXR.File({"type": OpenEXR.tiledimage, "tiles": tiles}, {"Y": pixels}).write(path)
    assert np.array_equal(exr.read_exr(path).channels["Y"], pixels)
