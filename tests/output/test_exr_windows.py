"""EXR files of other programs: windows, parts, and sizes that cannot be."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import OpenEXR
import pytest

from itmo_video.errors import InputError
from itmo_video.evaluation.agreement import Display, compare_sequences
from itmo_video.evaluation.folders import read_rgb
from itmo_video.model import Half
from itmo_video.output.exr import read_exr

Window = tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]


def picture(height: int = 12, width: int = 20) -> Half:
    y, x = np.mgrid[:height, :width]
    return np.dstack([x / width, y / height, 0.5 + 0 * x]).astype(np.float16)


def write(path: Path, rgb: Half, data: Window | None = None, display: Window | None = None) -> Path:
    header: dict[str, Any] = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION}
    if data is not None:
        header["dataWindow"] = data
    if display is not None:
        header["displayWindow"] = display
    OpenEXR.File(header, {"RGB": np.ascontiguousarray(rgb)}).write(str(path))
    return path


def window(left: int, top: int, right: int, bottom: int) -> Window:
    return (np.array([left, top], np.int32), np.array([right, bottom], np.int32))


@pytest.mark.parametrize("data", [(0, 0, 19, 11), (3, 2, 16, 9), (-2, -3, 25, 14), (5, -1, 30, 6),
    (-9, -9, -3, -3)])  # fmt: skip
def test_the_data_window_is_placed_in_the_display_window(
    tmp_path: Path, data: tuple[int, int, int, int]
) -> None:
    left, top, right, bottom = data
    big = picture(40, 60)
    shot = big[top + 10 : bottom + 11, left + 10 : right + 11]
    path = write(tmp_path / "a.exr", shot, window(*data), window(0, 0, 19, 11))
    want = np.zeros((12, 20, 3), np.float32)
    for y in range(max(top, 0), min(bottom, 11) + 1):
        for x in range(max(left, 0), min(right, 19) + 1):
            want[y, x] = big[y + 10, x + 10]
    np.testing.assert_array_equal(read_rgb(path), want)


def test_evaluate_compares_a_cropped_truth_in_place(tmp_path: Path) -> None:
    (tmp_path / "test").mkdir()
    (tmp_path / "truth").mkdir()
    whole = picture()
    whole[:3] = whole[10:] = whole[:, :4] = whole[:, 15:] = 0
    write(tmp_path / "test/a.0001.exr", whole)
    cropped = whole[3:10, 4:15].copy()
    write(tmp_path / "truth/a.0001.exr", cropped, window(4, 3, 14, 9), window(0, 0, 19, 11))
    found = compare_sequences(tmp_path / "test", tmp_path / "truth", None, Display(1000.0, 203.0))
    assert found["test"].figures["pq_psnr_db"] > 200


def parts_of(path: Path) -> Path:
    kind = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION}
    depth = OpenEXR.Part({**kind, "name": "depth"}, {"Z": np.ones((12, 20), np.float32)})
    left = OpenEXR.Part({**kind, "name": "left"}, {"RGB": np.full((12, 20, 3), 0.5, np.float16)})
    right = OpenEXR.Part({**kind, "name": "right"}, {"RGB": np.full((12, 20, 3), 2, np.float16)})
    OpenEXR.File([depth, left, right]).write(str(path))
    return path


def test_the_part_asked_for_is_read(tmp_path: Path) -> None:
    path = parts_of(tmp_path / "a.exr")
    assert read_rgb(path)[0, 0, 0] == 0.5
    assert read_rgb(path, "right")[0, 0, 0] == read_rgb(path, "2")[0, 0, 0] == 2
    assert set(read_exr(path, part="depth").channels) == {"Z"}
    with pytest.raises(InputError, match="no part middle"):
        read_rgb(path, "middle")
    with pytest.raises(InputError, match="no part left, only one"):
        read_rgb(write(tmp_path / "b.exr", picture()), "left")


def test_enormous_files_are_refused_unread(tmp_path: Path) -> None:
    data = bytearray(write(tmp_path / "a.exr", picture()).read_bytes())
    for name in (b"dataWindow\0", b"displayWindow\0"):
        at = data.index(name) + len(name) + len(b"box2i\0") + 4
        data[at : at + 16] = struct.pack("<4i", 0, 0, 99999, 99999)
    (tmp_path / "b.exr").write_bytes(bytes(data))
    with pytest.raises(InputError, match=r"would take|implausible"):
        read_rgb(tmp_path / "b.exr")


def test_windows_without_a_size_are_damage(tmp_path: Path) -> None:
    data = bytearray(write(tmp_path / "a.exr", picture()).read_bytes())
    at = data.index(b"dataWindow\0") + 11 + 6 + 4
    data[at : at + 16] = struct.pack("<4i", 5, 0, 4, 9)
    (tmp_path / "b.exr").write_bytes(bytes(data))
    with pytest.raises(InputError, match="size"):
        read_exr(tmp_path / "b.exr")
