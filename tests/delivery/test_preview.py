"""Previews as players see them: tags, light levels and pixels in nits."""

from __future__ import annotations

import json
import shutil
import struct
import subprocess
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from oracles import hlg_nits

from itmo_video import convert, make_settings, read_exr
from itmo_video.cli.main import main
from itmo_video.colour import chroma, primaries, transfer
from itmo_video.delivery import hdr, metadata
from itmo_video.delivery.choices import Codec, View
from itmo_video.delivery.film_spec import HIGH_CRF
from itmo_video.delivery.preview import PreviewSummary, preview
from itmo_video.delivery.preview_options import PreviewOptions
from itmo_video.model import Float64

PEAK = 1000.0
FILMS = [
    ("hdr10", "av1", ".mp4"),
    ("hdr10", "av1", ".mkv"),
    ("hdr10", "hevc", ".mp4"),
    ("hdr10", "prores", ".mov"),
    ("hlg", "av1", ".mp4"),
    ("hlg", "hevc", ".mp4"),
]


@pytest.fixture(scope="module")
def exrs(scene: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("exr") / "out"
    convert(scene, folder, make_settings(peak_nits=PEAK))
    return folder


def nits_of(folder: Path) -> list[Float64]:
    """BT.2020 R, G, B in nits of each EXR (3, H, W), by float64 and another road than ours."""
    matrix = primaries.rgb_to_rgb_matrix("rec709", "rec2020")
    out = []
    for path in sorted(folder.glob("*.exr")):
        channels = read_exr(path).channels
        rgb = np.stack([channels[c].astype(np.float64) for c in "RGB"]) * 203.0
        out.append(np.asarray(np.clip(np.einsum("ij,jhw->ihw", matrix, rgb), 0, PEAK)))
    return out


def decoded_nits(path: Path, view: str) -> list[Float64]:
    out = []
    with av.open(str(path)) as box:
        for frame in box.decode(video=0):
            planes = []
            for plane in frame.planes:
                rows = np.frombuffer(memoryview(plane), np.uint16).reshape(plane.height, -1)
                planes.append(rows[:, : plane.width].copy())
            size = (frame.width, frame.height)
            y = (planes[0] - 64.0) / 876
            cb, cr = ((chroma.upsample_chroma(p, size, "left") - 512) / 896 for p in planes[1:])
            red, blue = y + 1.4746 * cr, y + 1.8814 * cb
            green = (y - 0.2627 * red - 0.0593 * blue) / 0.6780
            code = np.stack([red, green, blue])
            out.append(transfer.pq_nits(code) if view == "hdr10" else hlg_nits(code, PEAK))
    return out


@pytest.mark.parametrize(("view", "codec", "suffix"), FILMS)
def test_film_is_tagged_measured_and_shows_the_exrs_nits(
    scene: Path, exrs: Path, tmp_path: Path, view: View, codec: Codec, suffix: str
) -> None:
    film = tmp_path / f"film{suffix}"
    options = PreviewOptions(view=view, codec=codec, crf=HIGH_CRF.get(codec))
    summary = preview(scene, film, make_settings(peak_nits=PEAK), options=options)
    truth = nits_of(exrs)
    largest = [frame.max(axis=0) for frame in truth]
    max_cll, max_fall = max(m.max() for m in largest), max(m.mean() for m in largest)
    assert summary.max_cll == pytest.approx(max_cll, rel=0.01), "MaxCLL differs from the EXRs'"
    assert summary.max_fall == pytest.approx(max_fall, rel=0.01), "MaxFALL differs from the EXRs'"
    told = told_by_stream(film)
    assert told["tags"] == (9, 16 if view == "hdr10" else 18, 9, 1), "primaries, transfer, ..."
    if view == "hdr10":
        if codec != "prores":
            assert told["light"][0] == pytest.approx(max_cll, rel=0.01), "MaxCLL in the stream"
            assert told["light"][1] == pytest.approx(max_fall, abs=0.01 * max_fall + 0.5)
            assert told["mastering"] == pytest.approx((PEAK, 0.005), rel=0.02), "mastering display"
        if suffix != ".mkv":
            check_boxes(film, max_cll, max_fall)
    shown = decoded_nits(film, view)
    assert len(shown) == len(truth), "frames are missing"
    errors, peaks = [], []
    for is_, should in zip(shown, truth, strict=True):
        luminance_is, luminance_should = (np.array([0.2627, 0.678, 0.0593]) @ p.reshape(3, -1)
                                          for p in (is_, should))  # fmt: skip
        errors.append(np.abs(luminance_is - luminance_should) / np.maximum(luminance_should, 0.05))
        peaks.append((is_.max(), should.max()))
    median = float(np.median(np.concatenate(errors)))
    assert median <= 0.02, f"{view} {codec}: median error {median:.2%} of luminance"
    peak_is, peak_should = np.max(peaks, axis=0)
    assert peak_is == pytest.approx(peak_should, rel=0.05), "the peak is not where it was"


def test_ffprobe_sees_chroma_sited_left(scene: Path, tmp_path: Path) -> None:
    if shutil.which("ffprobe") is None:
        pytest.skip("ffprobe is not installed")
    films = {"a.mp4": "hdr10", "a.mkv": "sdr", "b.mp4": "hlg", "still.avif": "hdr10"}
    for name, view in films.items():
        path = tmp_path / name
        one = ["--frame", "2"] if path.suffix == ".avif" else ["--frames", "2-3"]
        assert main(["preview", "--quiet", str(scene), str(path), "--as", view, *one]) == 0
        command = ["ffprobe", "-v", "error", "-show_streams", "-of", "json", str(path)]
        told = json.loads(subprocess.run(command, capture_output=True, check=True).stdout)
        assert told["streams"][0]["chroma_location"] == "left", name


def told_by_stream(film: Path) -> dict[str, Any]:
    with av.open(str(film)) as box:
        stream = box.streams.video[0]
        c = stream.codec_context
        told: dict[str, Any] = {
            "tags": (
                int(c.color_primaries),
                int(c.color_trc),
                int(c.colorspace),
                int(c.color_range),
            )
        }
        frame = next(box.decode(video=0))
        sides: Any = frame.side_data  # PyAV's types know of motion vectors only
        found = {data.type.name: bytes(data) for data in map(sides.__getitem__, range(len(sides)))}
        # PyAV 19 (FFmpeg 9) tells what holds for the whole stream on the decoder alone.
        for kind, data in getattr(c, "decoded_side_data", {}).items():
            found.setdefault(kind.name, data)
        if (light := found.get("CONTENT_LIGHT_LEVEL")) is not None:
            told["light"] = struct.unpack("<2I", light[:8])
        if (mastering := found.get("MASTERING_DISPLAY_METADATA")) is not None:
            numbers = struct.unpack("<20i", mastering[:80])
            told["mastering"] = numbers[18] / numbers[19], numbers[16] / numbers[17]
    return told


def check_boxes(film: Path, max_cll: float, max_fall: float) -> None:
    """The container's own mdcv and clli, as ffprobe reads them; by bytes where it is missing."""
    data = film.read_bytes()
    at = data.index(b"clli")
    cll, fall = struct.unpack_from(">2H", data, at + 4)
    assert cll == pytest.approx(max_cll, rel=0.01), "MaxCLL in the container"
    assert fall == pytest.approx(max_fall, abs=0.01 * max_fall + 0.5), "MaxFALL in the container"
    if not shutil.which("ffprobe"):
        return
    command = ["ffprobe", "-v", "error", "-show_streams", "-of", "json", str(film)]
    told = json.loads(subprocess.run(command, capture_output=True, check=True).stdout)
    video = told["streams"][0]
    by_type = {d["side_data_type"]: d for d in video["side_data_list"]}
    assert by_type["Content light level metadata"]["max_content"] == cll
    assert by_type["Mastering display metadata"]["max_luminance"] == "10000000/10000"
    assert video["color_transfer"] == "smpte2084"
    assert video["color_primaries"] == "bt2020"
    assert video["color_range"] == "tv"


def test_folder_and_clip_make_the_same_film(scene: Path, exrs: Path, tmp_path: Path) -> None:
    one, two = tmp_path / "one.mp4", tmp_path / "two.mp4"
    settings = make_settings(peak_nits=PEAK)
    first: PreviewSummary = preview(scene, one, settings)
    second = preview(exrs, two)
    assert (first.max_cll, first.max_fall) == (second.max_cll, second.max_fall)
    assert (decoded_nits(one, "hdr10")[5] == decoded_nits(two, "hdr10")[5]).all(), "other pixels"


def test_light_levels_that_would_be_escaped_are_moved_by_a_nit() -> None:
    assert metadata._unescaped(hdr.Light(512, 2)) == (513, 2), "H.265 would escape 00 00 02"
    assert metadata._unescaped(hdr.Light(512, 80)) == (512, 80)
