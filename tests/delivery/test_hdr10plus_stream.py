"""HDR10+ in the stream: what ffprobe and MediaInfo read is what the file says, frame by frame."""

from __future__ import annotations

import ctypes
import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import av
import pytest
from clips import moving_scene, write_ffv1

from itmo_video import InputError, PreviewOptions, UsageError, preview
from itmo_video.cli.main import main
from itmo_video.delivery.hdr10plus import read_hdr10plus
from itmo_video.delivery.messages import with_message

FRAMES, CUT = 12, 7
QUICK = {"av1": "10", "hevc": "ultrafast"}


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("hdr10plus")
    return write_ffv1(folder / "c.mkv", moving_scene(FRAMES, cuts=(CUT,)))


@pytest.fixture(scope="module")
def plus(clip: Path) -> Path:
    out = clip.parent / "plus.json"
    assert main(["analyse", str(clip), "--hdr10plus", str(out), "--quiet"]) == 0
    return out


def film_of(clip: Path, name: str, codec: Any, plus: Path | None) -> Path:
    out = clip.parent / name
    options = PreviewOptions(codec=codec, speed=QUICK[codec], hdr10plus=plus)
    preview(clip, out, options=options)
    return out


@pytest.fixture(scope="module", params=["av1.mp4", "av1.mkv", "hevc.mp4", "hevc.mkv"])
def film(clip: Path, plus: Path, request: pytest.FixtureRequest) -> Path:
    return film_of(clip, request.param, request.param.partition(".")[0], plus)


def told_by_ffprobe(film: Path) -> list[dict[str, list[int]]]:
    """Each frame's ST 2094-40 as ffprobe reads it: numerators by name."""
    if shutil.which("ffprobe") is None:
        pytest.skip("ffprobe is not installed")
    command = ["ffprobe", "-v", "error", "-select_streams", "v", "-show_frames", str(film)]
    done = subprocess.run(command, capture_output=True, check=True, text=True, timeout=60)
    found = []
    for part in done.stdout.split("[SIDE_DATA]")[1:]:
        lines = part.partition("[/SIDE_DATA]")[0].split("\n")
        if "SMPTE2094-40" in part.split("\n")[1]:
            values: dict[str, list[int]] = {}
            for name, _, value in (line.partition("=") for line in lines[2:] if line):
                values.setdefault(name, []).append(int(value.partition("/")[0]))
            found.append(values)
    return found


class Rational(ctypes.Structure):
    _fields_ = (("num", ctypes.c_int), ("den", ctypes.c_int))


class Percentile(ctypes.Structure):
    _fields_ = (("percentage", ctypes.c_uint8), ("percentile", Rational))


class Window(ctypes.Structure):  # AVHDRPlusColorTransformParams up to what we write
    _fields_ = (
        ("corners", Rational * 4), ("centre", ctypes.c_uint16 * 2), ("angle", ctypes.c_uint8),
        ("axes", ctypes.c_uint16 * 3), ("overlap", ctypes.c_int), ("maxscl", Rational * 3),
        ("average_maxrgb", Rational), ("count", ctypes.c_uint8), ("distribution", Percentile * 15),
    )  # fmt: skip


class HdrPlus(ctypes.Structure):  # AVDynamicHDRPlus, likewise
    _fields_ = (
        ("country", ctypes.c_uint8), ("version", ctypes.c_uint8), ("windows", ctypes.c_uint8),
        ("first", Window),
    )  # fmt: skip


def told_by_decoder(film: Path) -> list[dict[str, list[int]]]:
    """The same by FFmpeg's own decoders inside of PyAV, dav1d for AV1."""
    found = []
    with av.open(str(film)) as box:
        for frame in box.decode(video=0):
            sides: Any = frame.side_data  # PyAV's types know of motion vectors only
            for side in map(sides.__getitem__, range(len(sides))):
                if side.type.name == "DYNAMIC_HDR_PLUS":
                    told = HdrPlus.from_buffer_copy(bytes(side))
                    spread = told.first.distribution[: told.first.count]
                    found.append({
                        "application version": [told.version],
                        "num_windows": [told.windows],
                        "maxscl": [value.num for value in told.first.maxscl],
                        "average_maxrgb": [told.first.average_maxrgb.num],
                        "distribution_maxrgb_percentage": [one.percentage for one in spread],
                        "distribution_maxrgb_percentile": [one.percentile.num for one in spread],
                    })  # fmt: skip
    return found


@pytest.mark.parametrize("told_by", [told_by_ffprobe, told_by_decoder])
def test_each_frame_has_the_numbers_of_the_file(film: Path, plus: Path, told_by: Any) -> None:
    if told_by is told_by_ffprobe and film.stem == "av1":
        return  # Debian 12's, which is 5.1, does not take them from dav1d
    entries = json.loads(plus.read_text())["SceneInfo"]
    lights = [entry["LuminanceParameters"] for entry in entries]
    assert lights[0] != lights[-1], "two shots"
    told = told_by(film)
    assert len(told) == FRAMES
    for values, light in zip(told, lights, strict=True):
        spread = light["LuminanceDistributions"]
        assert values["maxscl"] == light["MaxScl"]
        assert values["average_maxrgb"] == [light["AverageRGB"]]
        assert values["distribution_maxrgb_percentage"] == spread["DistributionIndex"]
        assert values["distribution_maxrgb_percentile"] == spread["DistributionValues"]
        assert values["application version"] == values["num_windows"] == [1]


def test_mediainfo_calls_it_hdr10plus(film: Path) -> None:
    if film.stem == "av1":
        return  # Debian 12's, which is 23.04, does not read AV1's metadata of that kind
    if shutil.which("mediainfo") is None:
        pytest.skip("mediainfo is not installed")
    command = ["mediainfo", "--Output=JSON", str(film)]
    done = subprocess.run(command, capture_output=True, check=True, timeout=60)
    tracks = json.loads(done.stdout)["media"]["track"]
    (video,) = (track for track in tracks if track["@type"] == "Video")
    assert "SMPTE ST 2094 App 4" in video["HDR_Format"]
    assert "HDR10+ Profile A" in video["HDR_Format_Compatibility"]


def test_the_pictures_are_those_of_the_film_without(clip: Path, film: Path) -> None:
    plain = film_of(clip, f"plain_{film.name}", film.stem, None)
    assert decoded(plain) == decoded(film)
    assert told_by_decoder(plain) == []


def decoded(film: Path) -> list[tuple[int | None, bytes]]:
    with av.open(str(film)) as box:
        return [(frame.pts, frame.to_ndarray().tobytes()) for frame in box.decode(video=0)]


def test_bytes_are_escaped_and_sizes_told() -> None:
    slice_ = b"\x00\x00\x01\x26\x01\xaf"
    message = bytes(300)
    out = with_message(b"\x00\x00\x00\x01\x46\x01\x50" + slice_, message, "hevc")
    unit = out[7 : -len(slice_)]
    assert out.endswith(slice_)
    assert unit[:9] == b"\x00\x00\x00\x01\x4e\x01\x04\xff\x2d"
    body = unit[9:]
    assert b"\x00\x00\x00" not in body
    assert body.replace(b"\x00\x00\x03", b"\x00\x00") == message + b"\x80"
    ahead, shown = b"\x32\x01\xaa", b"\x1a\x02\xbb\xcc"
    out = with_message(b"\x12\x00" + ahead + shown, b"\xb5" * 130, "av1")
    assert out == b"\x12\x00" + ahead + b"\x2a\x84\x01\x04" + b"\xb5" * 130 + b"\x80" + shown
    for codec in ("hevc", "av1"):
        with pytest.raises(ValueError, match="without a picture"):
            with_message(b"\x12\x00", b"\xb5", codec)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda d: d["SceneInfo"].pop(), "is for 11 frames, the film has 12"),
        (lambda d: d["SceneInfo"][3].update(BezierCurveData={"Anchors": [1]}), "profile B"),
        (lambda d: d["SceneInfo"][3].update(SequenceFrameIndex=0), "is not HDR10"),
        (lambda d: d["SceneInfo"][3]["LuminanceParameters"].update(AverageRGB=1e5), "whole number"),
        (lambda d: d["SceneInfo"][3]["LuminanceParameters"].update(MaxScl=[1, 2]), "number of"),
        (lambda d: d.clear(), "is not HDR10"),
    ],
)
def test_what_is_no_metadata_of_this_film_is_refused(
    clip: Path, plus: Path, tmp_path: Path, change: Any, said: str
) -> None:
    document = json.loads(plus.read_text())
    change(document)
    other = tmp_path / "other.json"
    other.write_text(json.dumps(document))
    with pytest.raises(InputError, match=said):
        preview(clip, tmp_path / "x.mkv", options=PreviewOptions(hdr10plus=other))
    assert not list(tmp_path.glob("x*"))


@pytest.mark.parametrize(
    ("name", "own", "said"),
    [
        ("x.mkv", {"view": "hlg"}, "HDR10 film"),
        ("x.mkv", {"display_peak": 400}, "HDR10 film"),
        ("x.mov", {"codec": "prores"}, "AV1 and HEVC"),
        ("x.y4m", {}, "AV1 and HEVC"),
        ("x.avif", {"frame": 2}, "for films"),
    ],
)
def test_what_has_no_place_for_it_is_refused(
    clip: Path, plus: Path, tmp_path: Path, name: str, own: dict[str, Any], said: str
) -> None:
    with pytest.raises(UsageError, match=said):
        preview(clip, tmp_path / name, options=PreviewOptions(hdr10plus=plus, **own))


def test_every_message_has_the_length_of_profile_a(plus: Path) -> None:
    bits = 56 + 2 + 27 + 1 + 4 * 17 + 4 + 9 * 24 + 10 + 3
    assert {len(message) for message in read_hdr10plus(plus)} == {-(-bits // 8)}
