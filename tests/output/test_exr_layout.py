"""What we lay out ourselves, held against OpenEXR and FFmpeg."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path

import av
import numpy as np
import OpenEXR
import pytest
from exr_pictures import header, picture

from itmo_video.model import Half
from itmo_video.output import exr

pytestmark = pytest.mark.usefixtures("loops")


def test_encoding_to_memory_equals_the_librarys_own_file(tmp_path: Path) -> None:
    attributes = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    rgb = dict(zip("RGB", picture(40, 50), strict=True))
    memory = io.BytesIO()
    OpenEXR.File(dict(attributes), dict(rgb), num_threads=0).write(memory)
    OpenEXR.File(dict(attributes), dict(rgb), num_threads=0).write(str(tmp_path / "a.exr"))
    assert memory.getvalue() == (tmp_path / "a.exr").read_bytes()


def noise(height: int, width: int) -> tuple[Half, Half, Half]:
    """Return R, G, B of random finite halves, which deflate cannot make smaller."""
    codes = np.random.default_rng(3).integers(0, 0x7C00, (3, height, width), dtype=np.uint16)
    return tuple(codes.view(np.float16))


@pytest.mark.parametrize("size", [(1, 1), (1, 7), (37, 50), (64, 33), (97, 16)])
def test_uncompressed_files_are_openexrs_to_the_byte(tmp_path: Path, size: tuple[int, int]) -> None:
    rgb, head = picture(*size), header(compression="none")
    exr.write_exr(tmp_path / "ours.exr", rgb, head, layers={"expand_map.Y": rgb[0]})
    channels = {**dict(zip("RGB", rgb, strict=True)), "expand_map.Y": rgb[0]}
    theirs = io.BytesIO()
    OpenEXR.File(exr._attributes(head), channels, num_threads=0).write(theirs)
    assert (tmp_path / "ours.exr").read_bytes() == theirs.getvalue()


@pytest.mark.parametrize("make", [picture, noise])
@pytest.mark.parametrize("size", [(1, 1), (16, 16), (37, 50), (97, 21)])
@pytest.mark.parametrize("compression", ["none", "zips", "zip"])
def test_what_we_lay_out_ourselves_opens_elsewhere(
    tmp_path: Path,
    compression: str,
    size: tuple[int, int],
    make: Callable[[int, int], tuple[Half, Half, Half]],
) -> None:
    """In OpenEXR, whose header must not tell it from its own, and in FFmpeg."""
    rgb, head = make(*size), header(compression=compression)
    exr.write_exr(tmp_path / "a.exr", rgb, head)
    channels = dict(zip("RGB", rgb, strict=True))
    whole = OpenEXR.File(exr._attributes(head), dict(channels), num_threads=0)
    whole.write(str(tmp_path / "b.exr"))
    ours, theirs = (exr.read_exr(tmp_path / name) for name in ("a.exr", "b.exr"))
    assert repr(ours.attributes) == repr(theirs.attributes)
    for name, plane in channels.items():
        assert np.array_equal(ours.channels[name].view(np.uint16), plane.view(np.uint16)), name
    with av.open(str(tmp_path / "a.exr")) as box:
        decoded = next(box.decode(video=0))
    height, width = size
    assert (decoded.format.name, decoded.height, decoded.width) == ("gbrpf16le", height, width)
    for name, stored in zip("GBR", decoded.planes, strict=True):
        codes = np.frombuffer(bytes(stored), np.uint16).reshape(-1, stored.line_size // 2)
        assert np.array_equal(codes[:height, :width], channels[name].view(np.uint16)), name
