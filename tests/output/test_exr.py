"""exr: what is written comes back, the same bytes each time; what cannot be is an OutputError."""

from __future__ import annotations

import dataclasses
import os
import threading
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
from exr_pictures import HEADER, REC709, header, is_whole, picture
from python_run import run_python

from itmo_video.compressions import WRITTEN as COMPRESSIONS
from itmo_video.model import Float32, Half
from itmo_video.output import exr

pytestmark = pytest.mark.usefixtures("loops")

LOSSY = {"b44": 0.05, "dwaa": 0.02, "dwab": 0.02}  # of the range of the smooth test picture

AP0 = (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767)  # SMPTE ST 2065-1


def temp_files(folder: Path) -> list[str]:
    return [name for name in os.listdir(folder) if name.endswith(".tmp")]


def test_names_come_without_loading_openexr() -> None:
    done = run_python("import sys, itmo_video.output.exr; print('OpenEXR' in sys.modules)")
    assert done.stdout.strip() == "False", done.stderr


@pytest.mark.parametrize("size", [(1, 1), (2, 3), (101, 77), (300, 40)])
@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_round_trip(tmp_path: Path, compression: str, size: tuple[int, int]) -> None:
    rgb = picture(*size)
    path = tmp_path / "a.exr"
    written = exr.write_exr(path, rgb, header(compression=compression))
    assert written == path.stat().st_size
    assert os.listdir(tmp_path) == ["a.exr"]
    image = exr.read_exr(path)
    assert image.size == size[::-1]
    assert set(image.channels) == set("RGB")
    for name, plane in zip("RGB", rgb, strict=True):
        back = image.channels[name]
        assert back.dtype == np.float16
        if compression in LOSSY:
            error = np.abs(back.astype(float) - plane.astype(float)).max()
            assert error <= LOSSY[compression] * 8
        else:
            assert np.array_equal(back.view(np.uint16), plane.view(np.uint16))


@pytest.mark.parametrize("compression", [n for n in COMPRESSIONS if n not in LOSSY])
def test_lossless_for_every_half(tmp_path: Path, compression: str) -> None:
    every = np.arange(65536, dtype=np.uint16).reshape(256, 256).view(np.float16)
    if compression == "pxr24":  # makes one NaN of another
        every = np.where(np.isnan(every), np.float16(0), every)
    exr.write_exr(
        tmp_path / "a.exr", (every, every[::-1], every.T), header(compression=compression)
    )
    back = exr.read_exr(tmp_path / "a.exr").channels
    for name, plane in (("R", every), ("G", every[::-1]), ("B", every.T)):
        assert np.array_equal(back[name].view(np.uint16), plane.view(np.uint16)), name


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_layers_and_alpha(tmp_path: Path, compression: str) -> None:
    rgb = picture(40, 50)
    rng = np.random.default_rng(1)
    alpha = rng.random((40, 50)).astype(np.float16)
    layers: dict[str, Half | Float32] = {
        "expand_map.Y": rng.random((40, 50)).astype(np.float32),
        "clip_mask.Y": (rng.random((40, 50)) > 0.5).astype(np.float16),
        "a_layer_with_a_name_longer_than_31_characters.Y": alpha,
    }
    head = header(compression=compression)
    exr.write_exr(tmp_path / "a.exr", rgb, head, alpha=alpha, layers=layers)
    back = exr.read_exr(tmp_path / "a.exr").channels
    assert set(back) == {"R", "G", "B", "A", *layers}
    # b44 packs noise badly, the dwa pair is lossy in layers named Y, pxr24 rounds float32.
    tolerance = {"b44": 0.3, "dwaa": 0.1, "dwab": 0.1, "pxr24": 1e-4}.get(compression, 0)
    for name, array in {"A": alpha, **layers}.items():
        assert back[name].dtype == array.dtype
        assert np.abs(back[name].astype(float) - array.astype(float)).max() <= tolerance


def test_attributes_come_back(tmp_path: Path) -> None:
    exr.write_exr(tmp_path / "a.exr", picture(3, 2), HEADER)
    attributes = exr.read_exr(tmp_path / "a.exr").attributes
    assert attributes["chromaticities"] == pytest.approx(REC709, abs=1e-7)
    assert attributes["whiteLuminance"] == 203.0
    assert attributes["framesPerSecond"] == HEADER.frame_rate
    assert attributes["pixelAspectRatio"] == pytest.approx(64 / 45, abs=1e-7)
    assert attributes["itmoTime"] == HEADER.time_s
    assert attributes["itmoSource"] == HEADER.source_name
    assert attributes["itmoSettings"] == HEADER.settings_text
    assert attributes["itmoFingerprint"] == HEADER.fingerprint
    assert attributes["compression"] == OpenEXR.ZIP_COMPRESSION
    code = attributes["timeCode"]
    assert (code.hours, code.minutes, code.seconds, code.frame) == (1, 2, 3, 4)
    assert code.dropFrame
    assert OpenEXR.checkColorMetadata(attributes) == OpenEXR.OK
    assert exr.read_exr(tmp_path / "a.exr").fingerprint == HEADER.fingerprint


@pytest.mark.parametrize("text", [None, "", "1:2:3:4", "24:00:00:00", "00:00:00:30", "soon"])
def test_a_timecode_that_does_not_fit_is_left_out(tmp_path: Path, text: str | None) -> None:
    exr.write_exr(tmp_path / "a.exr", picture(1, 1), header(timecode=text))
    assert "timeCode" not in exr.read_exr(tmp_path / "a.exr").attributes


@pytest.mark.parametrize(
    "time_s",
    [
        Fraction(0),
        Fraction(-1, 25),
        Fraction(2**31 - 1, 2**32 - 1),
        Fraction(5 * 10**9 + 1, 90000),  # 15 hours into a transport stream
        Fraction(10**12 + 1, 10**9),
        Fraction(-(2**33) - 1, 90001),
        Fraction(1, 2**40),
    ],
)
def test_times_fit_into_32_bits(tmp_path: Path, time_s: Fraction) -> None:
    exr.write_exr(tmp_path / "a.exr", picture(1, 1), header(time_s=time_s))
    back = exr.read_exr(tmp_path / "a.exr").attributes["itmoTime"]
    assert abs(back - time_s) < Fraction(1, 10**8)


def test_no_frame_rate(tmp_path: Path) -> None:
    exr.write_exr(tmp_path / "a.exr", picture(1, 1), header(frame_rate=Fraction(0)))
    assert "framesPerSecond" not in exr.read_exr(tmp_path / "a.exr").attributes


def test_undecodable_source_name(tmp_path: Path) -> None:
    exr.write_exr(tmp_path / "a.exr", picture(1, 1), header(source_name="a\udcff.mp4"))
    assert exr.read_exr(tmp_path / "a.exr").attributes["itmoSource"] == "a\\udcff.mp4"


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_same_input_same_bytes(tmp_path: Path, compression: str) -> None:
    head = header(compression=compression)
    layers: dict[str, Half | Float32] = {
        "m.Y": np.ones((70, 90), np.float32),
        "b.Y": np.zeros((70, 90), np.float16),
    }
    exr.write_exr(tmp_path / "a.exr", picture(70, 90), head, layers=layers)
    swapped = dict(reversed(layers.items()))
    padded = np.zeros((3, 70, 180), np.float16)
    padded[..., ::2] = picture(70, 90)
    red, green, blue = padded[..., ::2]
    exr.write_exr(str(tmp_path / "b.exr"), (red, green, blue), head, layers=swapped, durable=True)
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()


def test_threads_write_the_same_bytes(tmp_path: Path) -> None:
    rgb = picture(200, 300)
    work = [lambda i=i: exr.write_exr(tmp_path / f"{i}.exr", rgb, HEADER) for i in range(8)]
    threads = [threading.Thread(target=job) for job in work]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len({(tmp_path / f"{i}.exr").read_bytes() for i in range(8)}) == 1
    assert temp_files(tmp_path) == []


def test_what_is_written_is_not_changed(tmp_path: Path) -> None:
    rgb = picture(5, 5)
    layers: dict[str, Half | Float32] = {"m.Y": np.ones((5, 5), np.float32)}
    before = [plane.copy() for plane in rgb]
    exr.write_exr(tmp_path / "a.exr", rgb, HEADER, layers=layers)
    assert all(np.array_equal(a, b) for a, b in zip(before, rgb, strict=True))
    assert type(layers["m.Y"]) is np.ndarray


def test_aces_container(tmp_path: Path) -> None:
    head = header(compression="none", chromaticities=AP0, is_aces_container=True)
    exr.write_exr(tmp_path / "a.exr", picture(4, 4), head)
    attributes = exr.read_exr(tmp_path / "a.exr").attributes
    assert attributes["acesImageContainerFlag"] == 1
    assert OpenEXR.checkColorMetadata(attributes) == OpenEXR.OK
    for changes in ({"compression": "zip"}, {"chromaticities": REC709}):
        with pytest.raises(ValueError, match="ACES"):
            exr.write_exr(tmp_path / "b.exr", picture(4, 4), dataclasses.replace(head, **changes))


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"rgb": (np.zeros((2, 2), np.float32),) * 3}, "float32"),
        ({"rgb": (np.zeros((2, 2, 1), np.float16),) * 3}, "shape"),
        ({"rgb": (np.zeros((0, 2), np.float16),) * 3}, "shape"),
        ({"rgb": (*picture(2, 2)[:2], np.zeros((2, 3), np.float16))}, "shape"),
        ({"alpha": np.zeros((2, 2), np.float32)}, "float32"),
        ({"layers": {"m.Y": np.zeros((3, 2), np.float16)}}, "shape"),
        ({"layers": {"m.Y": np.zeros((2, 2))}}, "float64"),
        ({"layers": {"R": np.zeros((2, 2), np.float16)}}, "name"),
        ({"header": header(compression="lzma")}, "lzma"),
    ],
)
def test_wrong_arguments(tmp_path: Path, changes: dict[str, Any], match: str) -> None:
    arguments = {"rgb": picture(2, 2), "header": HEADER, **changes}
    with pytest.raises(ValueError, match=match):
        exr.write_exr(tmp_path / "a.exr", **arguments)
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize(
    "name", ["a b.exr", "100%d.exr", "x:y.exr", "é文.exr", "\udcff.exr", "x" * 251 + ".exr"]
)
def test_hostile_names(tmp_path: Path, name: str) -> None:
    exr.write_exr(tmp_path / name, picture(2, 2), HEADER)
    assert is_whole(tmp_path / name)
    assert os.listdir(tmp_path) == [name]
