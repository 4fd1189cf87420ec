"""What an EXR says of itself, held against OpenImageIO, OpenColorIO and USD; settings in use."""

from __future__ import annotations

import dataclasses
import json
import re
import subprocess
from pathlib import Path
from typing import Any

import clips
import command
import numpy as np
import pytest

from itmo_video import RunOptions, convert, make_settings, read_exr
from itmo_video.colour.primaries import INTEROP_IDS, OCIO_NAMES
from itmo_video.errors import UsageError
from itmo_video.look import make_look
from itmo_video.operators import OPERATORS
from itmo_video.settings import Settings


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("clip")
    return clips.write_ffv1(folder / "a b.mkv", clips.moving_scene(4), fps=24)


def attributes(path: Path) -> dict[str, Any]:
    return read_exr(path).attributes


@pytest.mark.parametrize("primaries", list(INTEROP_IDS))
def test_oiio_and_ocio_see_the_colour_space(clip: Path, tmp_path: Path, primaries: str) -> None:
    oiio = pytest.importorskip("OpenImageIO")
    ocio = pytest.importorskip("PyOpenColorIO")
    convert(clip, tmp_path, make_settings(primaries=primaries), RunOptions(frames="2"))
    picture = oiio.ImageInput.open(str(tmp_path / "a b.0002.exr"))
    told = picture.spec().get_string_attribute("oiio:ColorSpace")
    assert INTEROP_IDS[primaries] in (
        told, picture.spec().get_string_attribute("colorInteropID"),
    )  # fmt: skip
    config = ocio.Config.CreateFromBuiltinConfig("ocio://default")
    space = config.getColorSpace(told)
    assert space.getName() == OCIO_NAMES[primaries]
    assert space.getInteropID() == INTEROP_IDS[primaries]


def test_an_aces_container_names_its_space_too(clip: Path, tmp_path: Path) -> None:
    settings = make_settings(primaries="aces2065-1", compression="none")
    convert(clip, tmp_path, settings, RunOptions(frames="1"))
    found = attributes(tmp_path / "a b.0001.exr")
    assert (found["acesImageContainerFlag"], found["colorInteropID"]) == (1, "lin_ap0_scene")


def test_owner_comments_and_a_timecode_by_frame_numbers(clip: Path, tmp_path: Path) -> None:
    settings = make_settings(owner="Ä. Owner", comments="first\nsecond", timecode="auto")
    convert(clip, tmp_path, settings, RunOptions(start_number=1000))
    for number in range(1000, 1004):
        found = attributes(tmp_path / f"a b.{number}.exr")
        assert (found["owner"], found["comments"]) == ("Ä. Owner", "first\nsecond")
        code = found["timeCode"]
        seconds = code.hours * 3600 + code.minutes * 60 + code.seconds
        assert seconds * 24 + code.frame == number


def test_a_given_timecode_counts_from_the_first_frame(clip: Path, tmp_path: Path) -> None:
    settings = make_settings(timecode="10:00:00:23")
    convert(clip, tmp_path, settings, RunOptions(start_number=1000, frames="1001"))
    code = attributes(tmp_path / "a b.1001.exr")["timeCode"]
    assert (code.hours, code.minutes, code.seconds, code.frame) == (10, 0, 1, 0)


@pytest.mark.parametrize("code", ["1:2:3:4", "24:00:00:00", "00:00:00", "now"])
def test_no_timecode_is_a_usage_error(code: str) -> None:
    with pytest.raises(UsageError, match="timecode"):
        make_settings(timecode=code)


@pytest.mark.parametrize("code", ["00:00:00:24", "00:00:00;02"])
def test_a_timecode_that_the_rate_does_not_count(clip: Path, tmp_path: Path, code: str) -> None:
    with pytest.raises(UsageError, match=code.replace(";", "|drop-frame;")[:11] + "|drop"):
        convert(clip, tmp_path, make_settings(timecode=code), RunOptions())
    assert not list(tmp_path.iterdir())


def test_above_30_fps_a_timecode_is_refused_not_left_out(tmp_path: Path) -> None:
    fast = clips.write_ffv1(tmp_path / "f.mkv", clips.moving_scene(2), fps=50)
    with pytest.raises(UsageError, match="at most 30 fps"):
        convert(fast, tmp_path / "out", make_settings(timecode="auto"))


OTHER: dict[str, Any] = {
    "lights": 64, "min_lights": 0, "soft_lights": True, "radius": 40.0, "map_width": 48,
    "edge_aware": False, "key_interval": 2, "temporal": "blend", "smooth_keys": 2,
    "l_white": 1.5, "projection": "latlong", "footage": "tone-mapped", "lamps": 2.0,
}  # fmt: skip


@pytest.mark.parametrize(
    ("operator", "changes"),
    [*((name, {}) for name in OPERATORS), ("banterle2006", {"temporal": "blend"}),
     *((name, {"expand_map": False}) for name in ("banterle2006", "auto", "linear"))],
)  # fmt: skip
def test_settings_that_are_not_told_have_no_effect(
    tmp_path: Path, operator: str, changes: dict[str, Any]
) -> None:
    source = clips.write_ffv1(tmp_path / "c.mkv", clips.moving_scene(3, width=64, height=48))
    base = Settings(operator=operator, compression="none", **changes)
    in_use = make_look(base).settings_in_use()
    idle = {name: value for name, value in OTHER.items() if name not in in_use}
    convert(source, tmp_path / "a", base, RunOptions(jobs=1))
    convert(source, tmp_path / "b", dataclasses.replace(base, **idle), RunOptions(jobs=1))
    for name in ("c.0001.exr", "c.0003.exr"):
        a, b = (read_exr(tmp_path / folder / name) for folder in "ab")
        for channel in "RGB":
            assert np.array_equal(a.channels[channel], b.channels[channel]), (name, idle)


def test_the_header_tells_what_the_operator_uses(clip: Path, tmp_path: Path) -> None:
    convert(clip, tmp_path, make_settings(), RunOptions(frames="1"))
    told = json.loads(attributes(tmp_path / "a b.0001.exr")["itmoSettings"])
    assert told["operator"] == "auto"
    assert not {"lights", "min_lights", "soft_lights", "l_white", "owner", "alpha", "fps"} & set(
        told
    )
    convert(clip, tmp_path / "b", Settings(), RunOptions(frames="1"))
    told = json.loads(attributes(tmp_path / "b" / "a b.0001.exr")["itmoSettings"])
    assert {"lights", "radius", "min_lights", "l_white", "strength"} <= set(told)


# ---- side files


def converted(clip: Path, folder: Path, *flags: str) -> subprocess.CompletedProcess[str]:
    return command.run("convert", clip, folder, *flags)


def test_a_nuke_node_has_an_ascii_name(clip: Path, tmp_path: Path) -> None:
    """Nuke's names are letters, digits and underscores, whatever the file's name is."""
    named = tmp_path / "nuit d'été 1.mkv"
    named.write_bytes(clip.read_bytes())
    done = converted(named, tmp_path / "o", "--side-files", "nuke", "--frames", "1")
    assert done.returncode == 0, done.stderr
    text = (tmp_path / "o" / "nuit d'été 1.nk").read_text("utf-8")
    assert re.search(r'^ name "Read_nuit_d__t__1"$', text, re.MULTILINE)


def test_nuke_and_ocio_side_files(clip: Path, tmp_path: Path) -> None:
    ocio = pytest.importorskip("PyOpenColorIO")
    done = converted(clip, tmp_path / "o", "--side-files", "nuke,ocio", "--primaries", "acescg")
    assert done.returncode == 0, done.stderr
    node = (tmp_path / "o" / "a b.nk").read_text()
    assert f'file "{tmp_path}/o/a b.%04d.exr"' in node
    assert "\n first 1\n last 4\n" in node
    assert 'colorspace "ACEScg"' in node
    rule = (tmp_path / "o" / "a b_ocio.yaml").read_text()
    text = (
        "ocio_profile_version: 2\nroles: {default: raw}\n"
        + rule.replace("file_rules:\n", "file_rules:\n", 1)
        + "  - !<Rule> {name: Default, colorspace: raw}\n"
        "displays: {d: [!<View> {name: v, colorspace: raw}]}\n"
        "colorspaces:\n  - !<ColorSpace> {name: raw}\n"
        "  - !<ColorSpace> {name: lin_ap1_scene}\n"
    )
    config = ocio.Config.CreateFromStream(text)
    config.validate()
    assert config.getColorSpaceFromFilepath("/x/a b.0003.exr")[0] == "lin_ap1_scene"
    assert config.getColorSpaceFromFilepath("/x/other.exr")[0] == "raw"


def test_a_usd_dome_light_opens_with_usd(clip: Path, tmp_path: Path) -> None:
    pytest.importorskip("pxr", reason="usd-core is not installed")
    from pxr import Usd, UsdLux

    done = converted(clip, tmp_path / "o", "--side-files", "usd", "--projection", "latlong")
    assert done.returncode == 0, done.stderr
    stage = Usd.Stage.Open(str(tmp_path / "o" / "a b_dome.usda"))
    dome = UsdLux.DomeLight(stage.GetDefaultPrim())
    texture = dome.GetTextureFileAttr()
    assert texture.GetColorSpace() == "lin_rec709_scene"
    assert dome.GetTextureFormatAttr().Get() == "latlong"
    for number in range(1, 5):
        resolved = Path(texture.Get(number).resolvedPath)
        assert resolved == tmp_path / "o" / f"a b.{number:04d}.exr"
        assert resolved.exists()
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (1, 4)
    assert stage.GetTimeCodesPerSecond() == 24


def test_side_files_are_refused_before_anything_is_made(clip: Path, tmp_path: Path) -> None:
    for flags in (("--side-files", "usd"), ("--side-files", "maya"),
                  ("--side-files", "nuke", "--null")):  # fmt: skip
        done = converted(clip, tmp_path / "o", *flags)
        assert done.returncode == 2, done.stderr
        assert not (tmp_path / "o").exists()


def test_somebody_elses_file_is_kept(clip: Path, tmp_path: Path) -> None:
    (tmp_path / "o").mkdir()
    (tmp_path / "o" / "a b.nk").write_text("set cut_paste_input [stack 0]\n")
    done = converted(clip, tmp_path / "o", "--side-files", "nuke")
    assert done.returncode == 5, done.stderr
    assert (tmp_path / "o" / "a b.nk").read_text() == "set cut_paste_input [stack 0]\n"
    # Ours is brought up to date.
    (tmp_path / "o" / "a b.nk").unlink()
    for frames in ("1-2", "1-4"):
        done = converted(clip, tmp_path / "o", "--side-files", "nuke", "--frames", frames)
        assert done.returncode == 0, done.stderr
    assert "\n last 4\n" in (tmp_path / "o" / "a b.nk").read_text()
