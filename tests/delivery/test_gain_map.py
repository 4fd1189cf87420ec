"""Gain-map stills: the HDR picture comes back, by libultrahdr and by the formula."""

from __future__ import annotations

import re
import shutil
import subprocess
from fractions import Fraction
from pathlib import Path
from typing import Any

import clips
import command
import cv2
import numpy as np
import pytest
from PIL import Image

from itmo_video import RunOptions, convert, make_settings, open_clip, read_exr
from itmo_video.colour.transfer import eotf, pq_code
from itmo_video.delivery.gain_map import GainMapMetadata, gain_map_jpeg
from itmo_video.delivery.preview import preview
from itmo_video.delivery.preview_options import PreviewOptions

PEAK = 1000 / 203
Picture = Any


def pictures(width: int = 160, height: int = 120) -> tuple[Picture, Picture]:
    """SDR and HDR, linear: a scene with a lamp of another hue, clipped in the SDR."""
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    base = 0.02 + 0.6 * (x / width)[..., None] * np.array([1, 0.7, 0.4], np.float32)
    lamp = np.exp(-((x - 40) ** 2 + (y - 50) ** 2) / 400)[..., None]
    scene = base + lamp * np.array([6, 4, 1.5], np.float32)
    return np.minimum(scene, 1), np.minimum(scene, PEAK)


def psnr_pq(a: Picture, b: Picture) -> float:
    codes = [pq_code(np.clip(picture, 0, PEAK).astype(np.float64) * 203) for picture in (a, b)]
    return float(-10 * np.log10(np.mean((codes[0] - codes[1]) ** 2)))


def by_formula(data: bytes) -> Picture:
    """The HDR rendition by the published formula and the file's own XMP, nothing of ours."""
    second = data.index(b"\xff\xd8\xff", 4)
    while b"hdrgm:GainMapMax" not in data[second : second + 3000]:
        second = data.index(b"\xff\xd8\xff", second + 3)
    base, gains = (
        cv2.imdecode(np.frombuffer(part, np.uint8), cv2.IMREAD_COLOR)
        for part in (data, data[second:])
    )
    assert base is not None
    assert gains is not None
    value = {
        name: float(number)
        for name, number in re.findall(rb'hdrgm:(\w+)="([-\d.]+)"', data[second : second + 3000])
    }
    low, high = value[b"GainMapMin"], value[b"GainMapMax"]
    stops = low + (high - low) * gains[..., ::-1] / 255
    linear = eotf(base[..., ::-1] / 255, "srgb")
    return (linear + value[b"OffsetSDR"]) * 2**stops - value[b"OffsetHDR"]


def by_libultrahdr(data: bytes) -> Picture:
    codecs = pytest.importorskip("imagecodecs", reason="imagecodecs is not installed")
    if not codecs.ULTRAHDR.available:
        pytest.skip("imagecodecs without libultrahdr")
    rgba = codecs.ultrahdr_decode(data, dtype="float16", transfer=0, boost=PEAK)
    return rgba[..., :3].astype(np.float64)


def test_its_sdr_base_is_what_the_reader_gives(tmp_path: Path) -> None:
    """OpenImageIO gives the HDR rendition of such a file, unasked, in half floats."""
    sdr, hdr = pictures()
    path = tmp_path / "ultra.jpg"
    path.write_bytes(gain_map_jpeg(sdr, hdr, PEAK))
    with open_clip(path) as clip, Image.open(path) as base:
        frame = next(iter(clip.frames()))
        assert frame.encoding.bit_depth == 8
        assert any("gain map" in notice for notice in clip.info.notices)
        np.testing.assert_array_equal(np.dstack(frame.planes), np.asarray(base.convert("RGB")))


@pytest.mark.parametrize("decoder", [by_formula, by_libultrahdr])
def test_the_hdr_picture_comes_back(decoder: Any) -> None:
    sdr, hdr = pictures()
    decoded = decoder(gain_map_jpeg(sdr, hdr, PEAK))
    assert psnr_pq(decoded, hdr) > 45
    # In the lamp's middle, by hue as well.
    assert np.abs(decoded[50, 40] / hdr[50, 40] - 1).max() < 0.05


def test_a_plain_decoder_sees_the_sdr_picture() -> None:
    sdr, hdr = pictures()
    data = np.frombuffer(gain_map_jpeg(sdr, hdr, PEAK), np.uint8)
    base = cv2.imdecode(data, cv2.IMREAD_COLOR)
    assert base is not None
    assert np.abs(eotf(base[..., ::-1] / 255, "srgb") - sdr).mean() < 0.005


def test_a_picture_that_is_no_brighter_is_one_too() -> None:
    sdr, _ = pictures()
    decoded = by_formula(gain_map_jpeg(sdr, sdr, 1.0))
    assert np.abs(decoded - sdr).max() < 0.02


def test_iso_21496_says_what_xmp_says() -> None:
    """The binary form read by its own layout: version, flags, headrooms, three channels."""
    meaning = GainMapMetadata(-0.25, 2.125, 2.300123)
    data = meaning.iso()
    assert data[:5] == b"\0\0\0\0\xc0"

    def fraction(at: int, signed: bool) -> Fraction:
        numerator = int.from_bytes(data[at : at + 4], "big", signed=signed)
        return Fraction(numerator, int.from_bytes(data[at + 4 : at + 8], "big"))

    assert fraction(5, False) == 0
    assert float(fraction(13, False)) == pytest.approx(2.300123, abs=1e-6)
    assert len(data) == 5 + 16 + 3 * 40
    for channel in range(3):
        at = 21 + 40 * channel
        assert float(fraction(at, True)) == -0.25
        assert float(fraction(at + 8, True)) == 2.125
        assert fraction(at + 16, False) == 1
        assert fraction(at + 24, True) == fraction(at + 32, True) == Fraction(1, 64)


def test_exiftool_finds_both_pictures() -> None:
    if shutil.which("exiftool") is None:
        pytest.skip("exiftool is not installed")
    sdr, hdr = pictures()
    told = subprocess.run(
        ["exiftool", "-a", "-G", "-ee", "-"], input=gain_map_jpeg(sdr, hdr, PEAK),
        capture_output=True, check=True,
    ).stdout.decode()  # fmt: skip
    assert "Number Of Images" in told
    assert re.search(r"Directory Item Semantic\s*: GainMap", told)
    assert re.search(r"MP Image 2\s*: \(Binary", told)
    assert re.search(r"HDR Capacity Max\s*: 2\.3004", told)
    assert "Warning" not in told


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("clip")
    return clips.write_ffv1(folder / "c.mkv", clips.moving_scene(3))


def test_preview_writes_the_exrs_light(clip: Path, tmp_path: Path) -> None:
    for more in ((), ("--primaries", "rec2020")):
        convert(clip, tmp_path / "exr", make_settings(), RunOptions(frames="2", overwrite=True))
        path = tmp_path / "frame.jpg"
        done = command.run("preview", clip, path, "--frame", "2", "--overwrite", *more)
        assert done.returncode == 0, done.stderr
        channels = read_exr(tmp_path / "exr" / "c.0002.exr").channels
        truth = np.dstack([channels[name] for name in "RGB"]).astype(np.float64)
        assert psnr_pq(by_formula(path.read_bytes()), truth) > 40


def test_a_base_with_alpha_is_over_black_as_the_hdr_picture_is(tmp_path: Path) -> None:
    """Colours under transparent pixels are arbitrary, and were shown by SDR displays only."""
    source, out = tmp_path / "a.png", tmp_path / "a.jpg"
    rgba = np.full((48, 64, 4), 200, np.uint8)
    rgba[:, :32, 3] = 0
    rgba[:, 32:, 3] = 255
    Image.fromarray(rgba).save(source)
    preview(source, out)
    base = np.asarray(Image.open(out), np.int64)
    assert base[:, :24].max() <= 2
    assert np.abs(base[:, 40:] - 200).max() <= 3
    compared = tmp_path / "both.png"
    preview(source, compared, options=PreviewOptions(view="compare", no_labels=True))
    assert np.asarray(Image.open(compared))[:, :24].max() <= 2


def test_of_a_folder_the_source_is_the_base(clip: Path, tmp_path: Path) -> None:
    convert(clip, tmp_path / "exr", make_settings())
    got = []
    for name, args in {
        "with.jpg": (tmp_path / "exr", "--source", clip), "clip.jpg": (clip,),
        "without.jpg": (tmp_path / "exr",),
    }.items():  # fmt: skip
        done = command.run("preview", args[0], tmp_path / name, "--frame", "2", *args[1:])
        assert done.returncode == 0, done.stderr
        got.append((tmp_path / name).read_bytes())
    assert got[0] == got[1]
    assert psnr_pq(by_formula(got[2]), by_formula(got[0])) > 40  # its base is tone-mapped


def test_a_still_needs_no_frame_number(clip: Path, tmp_path: Path) -> None:
    codes = next(iter(clips.moving_scene(1)))
    cv2.imwrite(str(tmp_path / "photo.png"), codes[..., ::-1])
    done = command.run("preview", tmp_path / "photo.png", tmp_path / "out.jpg")
    assert done.returncode == 0, done.stderr
    assert b"hdrgm:GainMapMax" in (tmp_path / "out.jpg").read_bytes()
    done = command.run("preview", clip, tmp_path / "clip.jpg")
    assert done.returncode == 2
    assert "--frame" in done.stderr
    done = command.run("preview", tmp_path / "photo.png", tmp_path / "sdr.jpg", "--as", "sdr")
    assert done.returncode == 0, done.stderr
    assert b"hdrgm" not in (tmp_path / "sdr.jpg").read_bytes()


PHOTOS = sorted((clips.SHARED / "data" / "gainmap_photos").glob("*.jp*g"))[:3]


@pytest.mark.skipif(not PHOTOS, reason="needs ../shared/data/gainmap_photos")
@pytest.mark.parametrize("photo", PHOTOS, ids=[path.stem for path in PHOTOS])
def test_photographs_written_again(photo: Path) -> None:
    """Decoded by libultrahdr, written by us, decoded again: 40 dB PQ at least (issue 25)."""
    data = photo.read_bytes()
    codecs = pytest.importorskip("imagecodecs", reason="imagecodecs is not installed")
    try:
        hdr = by_libultrahdr(data)
    except codecs.UltrahdrError:
        pytest.skip("libultrahdr does not read it")
    base = cv2.imdecode(
        np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION
    )
    assert base is not None
    size = (
        min(1024, base.shape[1]),
        round(min(1024, base.shape[1]) * base.shape[0] / base.shape[1]),
    )
    hdr = cv2.resize(hdr.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    sdr = cv2.resize(
        np.asarray(eotf(base[..., ::-1] / 255, "srgb"), np.float32),
        size,
        interpolation=cv2.INTER_AREA,
    )
    again = by_libultrahdr(gain_map_jpeg(sdr, np.minimum(hdr, PEAK), PEAK))
    assert psnr_pq(again, hdr) > 40
