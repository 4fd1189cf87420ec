"""Stills whose codes are no sRGB, and names that no library takes: read rightly or refused."""

from __future__ import annotations

import os
import struct
import sys
from pathlib import Path

import pytest
from PIL import Image
from stills import encoded, patches

from itmo_video.errors import AlreadyHdrError, InputError
from itmo_video.source.opening import open_clip
from itmo_video.source.tags import InputOptions


@pytest.mark.parametrize("profile", [0, 3, 4, 5, 6])
def test_digital_cinema_is_not_shown_as_srgb(tmp_path: Path, profile: int) -> None:
    data = bytearray(encoded(patches(), "JPEG2000"))
    at = data.index(b"\xff\x4f\xff\x51") + 6
    data[at : at + 2] = profile.to_bytes(2, "big")
    path = tmp_path / "a.jp2"
    path.write_bytes(data)
    if profile:
        with pytest.raises(AlreadyHdrError, match="X'Y'Z'") as caught:
            open_clip(path)
        assert "--transfer srgb" in str(caught.value.remedy)
    with open_clip(path, InputOptions(transfer="srgb")) as clip:
        assert clip.info.encoding.transfer == "srgb"


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="names are always Unicode there")
@pytest.mark.parametrize("form", ["PNG", "JPEG", "TIFF"])
def test_a_name_that_is_not_utf8(tmp_path: Path, form: str) -> None:
    path = Path(os.fsdecode(os.fsencode(tmp_path) + b"/lat\xff1.png"))
    path.write_bytes(encoded(patches(), form))
    with open_clip(path) as clip:
        assert next(clip.frames()).size == (128, 16)


def test_lab_is_not_shown_as_rgb(tmp_path: Path) -> None:
    path = tmp_path / "a.tif"
    Image.frombytes("LAB", (128, 16), patches().tobytes()).save(path)
    with pytest.raises(InputError, match=r"L\*a\*b\*"):
        open_clip(path)


@pytest.mark.parametrize(("mode", "channels"), [(3, 3), (4, 4), (9, 3)])
def test_psd_of_inks_and_lab_is_refused(tmp_path: Path, mode: int, channels: int) -> None:
    head = struct.pack(">4sH6xHIIHH", b"8BPS", 1, channels, 16, 128, 8, mode)
    pixels = patches()[..., [0, 1, 2, 0][:channels]].transpose(2, 0, 1).tobytes()
    path = tmp_path / "a.psd"
    path.write_bytes(head + bytes(12) + bytes(2) + pixels)
    if mode == 3:
        with open_clip(path) as clip:
            assert (next(clip.frames()).planes[0] == patches()[..., 0]).all()
        return
    with pytest.raises(InputError, match="its colours are"):
        open_clip(path)
