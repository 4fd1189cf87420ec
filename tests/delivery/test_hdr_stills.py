"""HDR stills: AVIF with light levels, HLG, 16-bit TIFF; read by other programs' libraries."""

from __future__ import annotations

import io
import json
import shutil
import struct
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import numpy.typing as npt
import pytest
from clips import moving_scene, write_ffv1
from oracles import hlg_nits
from PIL import Image, ImageCms
from stills import bgr_codes

from itmo_video import convert
from itmo_video.cli.main import main
from itmo_video.colour import chroma, transfer
from itmo_video.colour.primaries import rgb_to_rgb_matrix
from itmo_video.delivery import hdr
from itmo_video.delivery.avif_properties import with_light
from itmo_video.delivery.encoders import encode_avif
from itmo_video.delivery.metadata import mastering
from itmo_video.errors import OutputError
from itmo_video.output.exr import read_exr

Nits = npt.NDArray[np.float64]


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_ffv1(tmp_path_factory.mktemp("stills") / "c.mkv", moving_scene(1))


@pytest.fixture(scope="module")
def nits(clip: Path) -> Nits:
    """R, G and B in BT.2020 nits, (3, H, W), of the EXR."""
    convert(clip, clip.parent / "out")
    channels = read_exr(next((clip.parent / "out").glob("*.exr"))).channels
    rgb = np.stack([channels[c].astype(np.float64) for c in "RGB"]) * 203.0
    rgb = np.einsum("ij,jhw->ihw", rgb_to_rgb_matrix("rec709", "rec2020"), rgb)
    return np.asarray(np.clip(rgb, 0, 1000))


def made(clip: Path, path: Path, *flags: str) -> Path:
    assert main(["preview", str(clip), str(path), "--quiet", *flags]) == 0
    return path


def boxes(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    at = 0
    while at < len(data):
        size, kind = struct.unpack_from(">I4s", data, at)
        yield kind, data[at + 8 : at + size]
        at += size


def decoded(path: Path) -> tuple[Any, Nits]:
    """The frame, and its codes as R'G'B', (3, H, W), 0 to 1."""
    with av.open(str(path)) as box:
        frame = next(box.decode(video=0))
        planes = []
        for plane in frame.planes:
            rows = np.frombuffer(memoryview(plane), np.uint16).reshape(plane.height, -1)
            planes.append(rows[:, : plane.width].copy())
    y = (planes[0] - 64.0) / 876
    size = (frame.width, frame.height)
    cb, cr = ((chroma.upsample_chroma(p, size, "left") - 512) / 896 for p in planes[1:])
    red, blue = y + 1.4746 * cr, y + 1.8814 * cb
    return frame, np.stack([red, (y - 0.2627 * red - 0.0593 * blue) / 0.6780, blue])


def test_avif_has_light_levels_that_belong_to_its_picture(
    clip: Path, nits: Nits, tmp_path: Path
) -> None:
    path = made(clip, tmp_path / "a.avif")
    top = dict(boxes(path.read_bytes()))
    inside = dict(boxes(top[b"meta"][4:]))
    properties = dict(boxes(inside[b"iprp"]))
    listed = list(boxes(properties[b"ipco"]))
    associations = properties[b"ipma"][11:]
    owned = {
        listed[(number & 127) - 1][0]: listed[(number & 127) - 1][1] for number in associations
    }
    assert {b"av1C", b"ispe", b"colr", b"clli", b"mdcv"} <= set(owned)
    assert properties[b"ipma"][10] == len(associations)
    cll, fall = struct.unpack(">2H", owned[b"clli"])
    assert cll == pytest.approx(nits.max(), rel=2e-3, abs=0.6)
    assert fall == pytest.approx(nits.max(axis=0).mean(), rel=2e-3, abs=0.6)
    gx, gy, *_, top_nits, low = struct.unpack(">8H2I", owned[b"mdcv"])
    assert (gx, gy, top_nits, low) == (13250, 34500, 1000 * 10000, 50)
    with Image.open(path) as picture:  # libavif, which is strict
        assert picture.size == (96, 64)
        picture.load()


def test_the_picture_is_where_it_was_moved_to() -> None:
    rng = np.random.default_rng(3)
    sizes = ((64, 96), (32, 48), (32, 48))
    y, cb, cr = (rng.integers(64, 900, size).astype(np.uint16) for size in sizes)
    plain = encode_avif((y, cb, cr), 1)
    told = with_light(plain, mastering(600), hdr.Light(590, 33), "a.avif")
    assert len(told) == len(plain) + 12 + 32 + 2
    at = dict(boxes(told))[b"mdat"]
    assert at == dict(boxes(plain))[b"mdat"]
    (offset,) = struct.unpack_from(">I", told, told.index(b"iloc") + 18)
    assert told[offset : offset + 64] == at[:64]
    for broken in (plain[:-5], plain.replace(b"iloc", b"iloX"), plain[:60], b""):
        with pytest.raises(OutputError, match=r"^a.avif: light levels") as refused:
            with_light(broken, mastering(600), hdr.Light(590, 33), "a.avif")
        assert refused.value.remedy


def test_hlg_stills_show_the_exrs_nits(clip: Path, nits: Nits, tmp_path: Path) -> None:
    path = made(clip, tmp_path / "a.avif", "--as", "hlg", "--crf", "1")
    frame, code = decoded(path)
    assert (int(frame.color_primaries), int(frame.color_trc), int(frame.colorspace)) == (9, 18, 9)
    assert b"clli" not in path.read_bytes(), "HLG carries none"
    error = np.abs(hlg_nits(code, 1000.0) - nits) / np.maximum(nits, 1)
    assert np.median(error) < 0.02
    still = made(clip, tmp_path / "a.png", "--as", "hlg")
    png = still.read_bytes()
    at = png.index(b"cICP")
    assert png[at + 4 : at + 8] == bytes((9, 18, 0, 1))
    assert b"cLLI" not in png
    shown = hlg_nits(np.moveaxis(bgr_codes(still)[..., ::-1] / 65535.0, 2, 0), 1000.0)
    np.testing.assert_allclose(shown, nits, rtol=0.01, atol=0.05)


def test_tiff_is_pq_in_16_bits_and_says_so(clip: Path, nits: Nits, tmp_path: Path) -> None:
    tifffile = pytest.importorskip("tifffile")
    path = made(clip, tmp_path / "a.tif")
    with tifffile.TiffFile(path) as file:
        page = file.pages[0]
        codes = page.asarray()
        profile = page.tags[34675].value
    assert (codes.dtype, codes.shape) == (np.uint16, (64, 96, 3))
    shown = transfer.pq_nits(np.moveaxis(codes / 65535.0, 2, 0))
    np.testing.assert_allclose(shown, nits, rtol=4e-3, atol=2e-3)
    assert bytes(profile[bytes(profile).rindex(b"cicp") + 8 :][:4]) == bytes((9, 16, 0, 1))
    lcms = ImageCms.getOpenProfile(io.BytesIO(bytes(profile)))
    red = lcms.profile.red_primary
    assert red is not None
    assert red[1][:2] == pytest.approx((0.708, 0.292), abs=2e-3)
    np.testing.assert_array_equal(bgr_codes(path)[..., ::-1], codes)


def test_what_says_that_it_is_pq_is_refused_as_a_source(
    clip: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, flags in (("a.tif", []), ("a.png", []), ("h.png", ["--as", "hlg"])):
        path = made(clip, tmp_path / name, *flags)
        assert main(["convert", str(path), str(tmp_path / "o")]) == 6, name
        assert "already HDR" in capsys.readouterr().err


def test_sdr_views_are_tiff_too_and_hlg_is_not(clip: Path, tmp_path: Path) -> None:
    path = made(clip, tmp_path / "s.tif", "--as", "sdr")
    assert bgr_codes(path).dtype == np.uint8
    made(clip, path, "--as", "compare", "--overwrite")
    assert main(["preview", str(clip), str(tmp_path / "x.tif"), "--as", "hlg"]) == 2
    assert main(["preview", str(clip), str(tmp_path / "x.avif"), "--as", "sdr"]) == 2


def test_ffprobe_sees_them(clip: Path, tmp_path: Path) -> None:
    if shutil.which("ffprobe") is None:
        pytest.skip("ffprobe is not installed")
    for name, view, curve in (("a.avif", "hdr10", "smpte2084"), ("h.avif", "hlg", "arib-std-b67")):
        path = made(clip, tmp_path / name, "--as", view)
        command = ["ffprobe", "-v", "error", "-show_streams", "-of", "json", str(path)]
        told = json.loads(subprocess.run(command, capture_output=True, check=True).stdout)
        video = told["streams"][0]
        assert (video["color_primaries"], video["color_transfer"]) == ("bt2020", curve)
        assert video["pix_fmt"] == "yuv420p10le"


@pytest.mark.parametrize("size", [(61, 43), (60, 43), (61, 44)])
def test_avif_keeps_odd_sizes(size: tuple[int, int], tmp_path: Path) -> None:
    width, height = size
    codes = np.full((height, width, 3), 60, np.uint8)
    codes[-1, :, 1] = codes[:, -1, 1] = 200
    source = tmp_path / "odd.png"
    cv2.imwrite(str(source), codes)
    path = made(source, tmp_path / "odd.avif", "--crf", "1", "--as", "hlg")
    frame, seen = decoded(path)
    assert (frame.width, frame.height) == size
    green = seen[1] > 0.5
    assert green[-1].all()
    assert green[:, -1].all()
    assert not green[:-2, :-2].any()
    with Image.open(path) as picture:
        assert picture.size == size
        picture.load()


@pytest.mark.parametrize(
    ("name", "flags"),
    [
        ("a.mp4", ()),
        ("a.y4m", ("--as", "hlg")),
        ("c.mp4", ("--as", "compare")),
        ("a.avif", ()),
        ("a.png", ()),
        ("a.jpg", ()),
    ],
)
def test_alpha_over_black_is_said(
    name: str, flags: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    codes, told = np.full((64, 64, 4), 200, np.uint8), "transparent pixels are over black"
    codes[:, 32:, 3] = 0
    for kind, channels in (("cut", 4), ("opaque", 3)):
        source = tmp_path / f"{kind}.png"
        cv2.imwrite(str(source), codes[..., :channels])
        assert main(["preview", str(source), str(tmp_path / f"{kind}_{name}"), *flags]) == 0
        assert (told in capsys.readouterr().err) == (kind == "cut")


@pytest.mark.parametrize("size", [(1, 1), (2, 1), (1, 2), (3, 5), (4, 1), (1, 4)])
def test_stills_of_tiny_pictures(size: tuple[int, int], tmp_path: Path) -> None:
    source = tmp_path / "t.png"
    cv2.imwrite(str(source), np.full((size[1], size[0], 3), 200, np.uint8))
    for name in ("h.png", "t.tif", "g.jpg"):
        path = made(source, tmp_path / name, "--frame", "1")
        assert bgr_codes(path).shape == (size[1], size[0], 3)
    made(source, tmp_path / "dim.png", "--frame", "1", "--display-peak", "400")
    made(source, tmp_path / "hlg.png", "--frame", "1", "--as", "hlg")
