"""analyse --hdr10: the numbers are preview's, and encoders write what they are told."""

from __future__ import annotations

import json
import re
import shlex
import shutil
import subprocess
from pathlib import Path

import clips
import command
import pytest


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, list[str]], str]:
    """The clip, each encoder's options, and the first line."""
    folder = tmp_path_factory.mktemp("light")
    clip = clips.write_ffv1(folder / "c.mkv", clips.moving_scene(6))
    done = command.run("analyse", clip, "--hdr10", "--quiet")
    assert done.returncode == 0, done.stderr
    first, *lines = done.stdout.splitlines()
    options = {line.split(":")[0]: shlex.split(line.split(":", 1)[1]) for line in lines}
    return clip, options, first


def test_they_are_the_films(told: tuple[Path, dict[str, list[str]], str], tmp_path: Path) -> None:
    clip, _, first = told
    done = command.run("preview", clip, tmp_path / "film.y4m", "--json")
    last = json.loads(done.stdout.splitlines()[-1])
    found = re.fullmatch(r"MaxCLL (\d+) nits, MaxFALL (\d+) nits, mastering .* 1000 nits.*", first)
    assert found is not None, first
    assert [int(n) for n in found.groups()] == [round(last["max_cll"]), round(last["max_fall"])]


@pytest.mark.parametrize("encoder", ["x265", "SvtAv1EncApp", "ffmpeg"])
def test_encoders_write_them(
    told: tuple[Path, dict[str, list[str]], str], tmp_path: Path, encoder: str
) -> None:
    probe = shutil.which("ffprobe")
    if shutil.which(encoder) is None or probe is None:
        pytest.skip(f"{encoder} or ffprobe is not installed")
    clip, options, first = told
    stream = tmp_path / "film.y4m"
    assert command.run("preview", clip, stream).returncode == 0
    name = {"x265": "a.hevc", "SvtAv1EncApp": "a.ivf", "ffmpeg": "a.mkv"}[encoder]
    film = tmp_path / name
    line = {
        "x265": ["--y4m", str(stream), *options["x265"], "-o", str(film)],
        "SvtAv1EncApp": ["-i", str(stream), "--preset", "10", *options["SvtAv1EncApp"], "-b",
                         str(film)],
        "ffmpeg": ["-v", "error", "-i", str(stream), *options["ffmpeg"], str(film)],
    }[encoder]  # fmt: skip
    done = subprocess.run([encoder, *line], capture_output=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    seen = subprocess.run(
        [probe, "-v", "error", "-show_frames", "-read_intervals", "%+#1", "-of", "json", str(film)],
        capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    frame = json.loads(seen)["frames"][0]
    assert (frame["color_primaries"], frame["color_transfer"], frame["color_space"]) == (
        "bt2020", "smpte2084", "bt2020nc",
    )  # fmt: skip
    side = {data["side_data_type"]: data for data in frame["side_data_list"]}
    light = side["Content light level metadata"]
    assert f"MaxCLL {light['max_content']} nits, MaxFALL {light['max_average']} nits" in first
    display = side["Mastering display metadata"]

    def value(entry: str) -> float:
        top, bottom = display[entry].split("/")
        return float(top) / float(bottom)

    assert value("max_luminance") == pytest.approx(1000)
    assert (value("red_x"), value("green_y")) == pytest.approx((0.68, 0.69), abs=1e-3)


def test_presets_as_json() -> None:
    done = command.run("presets", "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert {"default", "paper"} <= set(told)
    assert all(preset["description"] for preset in told.values())
    assert told["paper"]["settings"]["operator"] == "banterle2006"
