"""ProRes 4444 and DNxHR in PQ and in log: published code values, and what decoders give back."""

from __future__ import annotations

import json
import shutil
import subprocess
import warnings
from pathlib import Path
from typing import Any

import av
import numpy as np
import numpy.typing as npt
import pytest
from clips import moving_scene, write_ffv1
from PIL import Image

from itmo_video import convert, make_settings
from itmo_video.cli.main import main
from itmo_video.colour import chroma, transfer
from itmo_video.colour.primaries import rgb_to_rgb_matrix
from itmo_video.delivery import metadata
from itmo_video.delivery.log_curves import PRIMARIES, acescct, log_codes, logc3
from itmo_video.delivery.ycbcr import to_ycbcr
from itmo_video.output.exr import read_exr

with warnings.catch_warnings():  # it tells of every optional library that it misses
    warnings.simplefilter("ignore")
    import colour as colour_science

SIZE = (160, 272)  # DNxHR begins at 256x120
Planes = npt.NDArray[np.float64]


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("masters")
    return write_ffv1(folder / "c.mkv", moving_scene(2, width=SIZE[1], height=SIZE[0]))


@pytest.fixture(scope="module")
def rgb(clip: Path) -> Planes:
    """The first frame's linear R, G and B, (3, H, W), 1.0 = SDR white."""
    out = clip.parent / "out"
    convert(clip, out)
    channels = read_exr(min(out.glob("*.exr"))).channels
    return np.stack([channels[c].astype(np.float64) for c in "RGB"])


def decoded(path: Path) -> Planes:
    """R', G', B' of the first frame by BT.709's matrix, or BT.2020's where tagged so."""
    with av.open(str(path)) as box:
        frame = next(box.decode(video=0))
        scale = 2.0 ** (frame.format.components[0].bits - 10)
        planes = []
        for plane in frame.planes:
            rows = np.frombuffer(memoryview(plane), np.uint16).reshape(plane.height, -1)
            planes.append(rows[:, : plane.width])
    y = (planes[0] / scale - 64) / 876
    size = (frame.width, frame.height)
    full = (
        p.astype(np.float64) if p.shape == y.shape
        else np.asarray(chroma.upsample_chroma(p, size, "left"), np.float64)
        for p in planes[1:3]
    )  # fmt: skip
    cb, cr = ((p / scale - 512) / 896 for p in full)
    kr, kb = (0.2126, 0.0722) if int(frame.colorspace) == 1 else (0.2627, 0.0593)
    red, blue = y + 2 * (1 - kr) * cr, y + 2 * (1 - kb) * cb
    return np.stack([red, (y - kr * red - kb * blue) / (1 - kr - kb), blue])


def made(clip: Path, path: Path, *flags: str) -> Path:
    assert main(["preview", str(clip), str(path), "--quiet", *flags]) == 0
    return path


def test_acescct_has_its_published_values() -> None:
    """S-2016-001's own table of values, and where line and logarithm meet."""
    published = {0.0: 0.0729055, 0.0078125: 0.1552511, 0.18: 0.4135884, 1.0: 0.5547945,
                 65504.0: 1.4679964}  # fmt: skip
    for linear, code in published.items():
        assert float(acescct(np.array(linear))) == pytest.approx(code, abs=1e-6)
    x = np.geomspace(1e-5, 60, 300)
    np.testing.assert_allclose(acescct(x), colour_science.models.log_encoding_ACEScct(x), atol=1e-9)


def test_logc3_has_its_published_values() -> None:
    """ARRI's table at EI 800: black at code 95, 18 % grey at 400 of 1023."""
    assert float(logc3(np.array(0.18))) * 1023 == pytest.approx(400.0, abs=0.01)
    assert float(logc3(np.array(0.0))) * 1023 == pytest.approx(94.94, abs=0.01)
    x = np.geomspace(1e-4, 50, 300)
    expected = colour_science.models.log_encoding_ARRILogC3(
        x, firmware="SUP 3.x", method="Linear Scene Exposure Factor", EI=800
    )
    np.testing.assert_allclose(logc3(x), expected, atol=2e-5)
    cut = 0.010591
    below, above = (float(logc3(np.array(cut * s))) for s in (1 - 1e-6, 1 + 1e-6))
    assert above - below < 1e-4, "the two parts meet"


@pytest.mark.parametrize("curve", ["acescct", "logc3"])
def test_white_stays_neutral_and_the_look_up_is_the_formula(curve: Any) -> None:
    level = np.geomspace(1e-3, 5, 64 * 32).reshape(32, 64).astype(np.float32)
    red, green, blue = log_codes((level, level, level), "rec709", curve)
    exact = (acescct if curve == "acescct" else logc3)(level)
    for plane in (red, green, blue):
        np.testing.assert_allclose(plane, exact, atol=1e-4)
    matrix = colour_science.matrix_RGB_to_RGB(
        colour_science.RGB_COLOURSPACES["ITU-R BT.709"],
        colour_science.RGB_COLOURSPACES["ACEScg" if curve == "acescct" else "ARRI Wide Gamut 3"],
        chromatic_adaptation_transform="Bradford",
    )
    assert rgb_to_rgb_matrix("rec709", PRIMARIES[curve]) == pytest.approx(matrix, abs=2e-4)


@pytest.mark.parametrize("codec", [["prores4444"], ["dnxhr"], ["dnxhr", "--chroma", "444"]])
@pytest.mark.parametrize("view", ["hdr10", "acescct", "logc3"])
def test_what_decodes_is_the_picture(
    clip: Path, rgb: Planes, tmp_path: Path, codec: list[str], view: str
) -> None:
    path = made(clip, tmp_path / "m.mov", "--as", view, "--codec", *codec)
    if view == "hdr10":
        linear = np.einsum("ij,jhw->ihw", rgb_to_rgb_matrix("rec709", "rec2020"), rgb)
        expected = transfer.pq_code(np.clip(linear * 203, 0, 1000))
    else:
        primaries = "acescg" if view == "acescct" else "alexa_wide_gamut"
        linear = np.einsum("ij,jhw->ihw", rgb_to_rgb_matrix("rec709", primaries), rgb)
        expected = (acescct if view == "acescct" else logc3)(linear)
    error = np.abs(decoded(path) - expected)
    assert np.median(error) < 1.5 / 876, "more than codes and dither"
    assert np.percentile(error, 99) < 0.03
    with av.open(str(path)) as box:
        context = box.streams.video[0].codec_context
        tags = (int(context.color_primaries), int(context.color_trc), int(context.colorspace))
        told = box.metadata.get("comment", "")
        assert tags == ((9, 16, 9) if view == "hdr10" else (2, 2, 1))
    words = {"hdr10": "", "acescct": "ACEScct, AP1", "logc3": "LogC3"}
    assert words[view] in told
    assert bool(told) == (view != "hdr10")
    data = path.read_bytes()
    assert (b"clli" in data) == (view == "hdr10"), "light levels are PQ's"


def test_ffprobe_sees_codec_profile_and_light(clip: Path, tmp_path: Path) -> None:
    if shutil.which("ffprobe") is None:
        pytest.skip("ffprobe is not installed")
    for codec, name, profile in (("prores4444", "prores", "4444"), ("dnxhr", "dnxhd", "DNXHR HQX")):
        path = made(clip, tmp_path / f"{codec}.mov", "--codec", codec)
        command = ["ffprobe", "-v", "error", "-show_streams", "-of", "json", str(path)]
        told = json.loads(subprocess.run(command, capture_output=True, check=True).stdout)
        video = told["streams"][0]
        assert (video["codec_name"], video["profile"]) == (name, profile)
        kinds = {data["side_data_type"] for data in video["side_data_list"]}
        assert kinds == {"Content light level metadata", "Mastering display metadata"}


@pytest.mark.parametrize(
    ("name", "flags", "words"),
    [
        ("a.mp4", ["--as", "logc3"], "log is for grading"),
        ("a.mp4", ["--codec", "prores4444"], "needs .mov"),
        ("a.mov", ["--codec", "prores4444", "--chroma", "422"], "is not 4:2:2"),
        ("a.mov", ["--codec", "dnxhr", "--chroma", "420"], "is not 4:2:0"),
        ("a.mov", ["--codec", "dnxhr", "--crf", "3"], "fixed quality"),
        ("a.png", ["--as", "acescct", "--frame", "1"], "log is for films"),
        ("a.mp4", ["--chroma", "444"], "4:2:0 only"),
    ],
)
def test_what_does_not_go_together_is_told(
    clip: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, flags: list[str],
    words: str,
) -> None:  # fmt: skip
    assert main(["preview", str(clip), str(tmp_path / name), *flags]) == 2
    assert words in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("size", "name", "flags", "words"),
    [
        ((512, 64), "a.mov", ["--codec", "dnxhr"], "too small for DNxHR"),
        ((512, 24), "a.mp4", [], "too small for AV1"),  # SVT-AV1 would never end
        ((512, 24), "a.avif", ["--frame", "1"], "too small for AVIF"),
        ((1, 1), "a.avif", ["--frame", "1"], "too small for AVIF"),
    ],
)
def test_pictures_too_small_for_an_encoder(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], size: tuple[int, int], name: str,
    flags: list[str], words: str,
) -> None:  # fmt: skip
    small = write_ffv1(tmp_path / "s.mkv", moving_scene(1, width=size[0], height=size[1]))
    assert main(["preview", str(small), str(tmp_path / name), *flags]) == 2
    assert words in capsys.readouterr().err
    assert not (tmp_path / name).exists()


@pytest.mark.parametrize(("codec", "size"), [("hevc", (14, 14)), ("av1", (64, 2))])
def test_too_small_a_picture_blames_no_sound(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], codec: str, size: tuple[int, int]
) -> None:
    path = tmp_path / "s.png"
    Image.new("RGB", size).save(path)
    assert main(["preview", str(path), str(tmp_path / "a.mp4"), "--codec", codec]) == 2
    told = capsys.readouterr().err
    assert "too small" in told
    assert "sound" not in told


@pytest.mark.parametrize("codec", ["prores", "dnxhr"])
def test_a_master_without_its_light_levels_is_an_error(
    codec: str, clip: Path, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    """In .mov the boxes alone state them; they were left out without a notice."""
    monkeypatch.setattr(metadata, "_VIDEO_ENTRIES", (b"av01",))  # as if its entry were unknown
    line = ["preview", str(clip), str(tmp_path / "m.mov"), "--codec", codec, "--quiet"]
    assert main(line) == 5
    assert "m.mov: the HDR metadata (mdcv, clli) could not be added" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_444_keeps_every_pixels_colour() -> None:
    rng = np.random.default_rng(5)
    code = [rng.uniform(0.1, 0.9, (8, 10)).astype(np.float32) for _ in range(3)]
    y, cb, cr = to_ycbcr((code[0], code[1], code[2]), "bt709", "444", 1)
    assert y.shape == cb.shape == cr.shape == (8, 10)
    blue = (y - 64.0) / 876 + 1.8556 * (cb - 512.0) / 896
    np.testing.assert_allclose(blue, code[2], atol=4e-3)


def test_prores_4444_keeps_alpha_with_straight_colours(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rng = np.random.default_rng(3)
    coarse = rng.integers(40, 220, (5, 9, 3), dtype=np.uint8)
    colours = np.kron(coarse, np.ones((33, 31, 1), np.uint8))  # both sizes are odd
    height, width = colours.shape[:2]
    alpha = np.broadcast_to(np.linspace(0, 255, width), (height, width)).astype(np.uint8)
    opaque, cut = tmp_path / "opaque.png", tmp_path / "cut.png"
    Image.fromarray(colours).save(opaque)
    Image.fromarray(np.dstack([colours, alpha])).save(cut)
    flags = ["--codec", "prores4444", "--as", "acescct", "--operator", "linear", "--l-max", "1"]
    plain = decoded(made(opaque, tmp_path / "plain.mov", *flags))
    convert(cut, tmp_path / "out", make_settings("default", operator="linear", l_max=1))
    for source, own in ((cut, flags), (tmp_path / "out", flags[:4])):
        film = made(source, tmp_path / f"{source.stem}.mov", *own)
        with av.open(str(film)) as box:
            frame = next(box.decode(video=0))
            assert frame.format.name.startswith("yuva444p"), frame.format.name
            depth = frame.format.components[3].bits
            rows = np.frombuffer(memoryview(frame.planes[3]), np.uint16).reshape(frame.height, -1)
        told = rows[:height, :width] / (2.0**depth - 1)
        np.testing.assert_allclose(told, alpha / 255, atol=1.5 / 1023)
        seen = alpha > 64  # of little light there is little to divide
        straight = decoded(film)[:, :height, :width]
        assert np.abs(straight - plain[:, :height, :width])[:, seen].mean() < 2e-3
    capsys.readouterr()
    done = main(["preview", str(cut), str(tmp_path / "no.mov"), "--codec", "dnxhr"])
    assert done == 0
    said = capsys.readouterr().err
    assert "alpha is not written: transparent pixels are over black; --codec prores4444" in said
    assert "the film is 280x166, the picture 279x165: the last column or row" in said
    made(cut, tmp_path / "no.y4m", "--codec", "prores4444")
    film = made(cut, tmp_path / "both.mov", "--codec", "prores4444", "--as", "compare")
    with av.open(str(film)) as box:
        assert next(box.decode(video=0)).format.name.startswith("yuv444p")
