"""analyse: what it finds, what its file may hold; convert --analysis: only edited shots change."""

from __future__ import annotations

import json
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from clips import exr_bytes, moving_scene, write_ffv1
from command import run

from itmo_video import RunOptions, analyse, convert, make_settings, read_analysis, read_exr
from itmo_video.analysis.model import Analysis, Bars, Shot, Statistics
from itmo_video.analysis.reading import parse_analysis
from itmo_video.analysis.suggestions import suggestions
from itmo_video.errors import InputError, OutputError, UsageError
from itmo_video.model import ClipInfo, Encoding

SETTINGS = make_settings("default", lights=64, radius=64, compression="none")
SHOTS = [(1, 17), (18, 18), (19, 30)]


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    frames = moving_scene(30, cuts=(17, 18))
    return write_ffv1(tmp_path_factory.mktemp("clip") / "scene.mkv", frames)


@pytest.fixture(scope="module")
def found(clip: Path) -> Analysis:
    return analyse(clip, SETTINGS)


@pytest.fixture(scope="module")
def plain(clip: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    out = tmp_path_factory.mktemp("plain")
    convert(clip, out, SETTINGS)
    return all_bytes(out)


def all_bytes(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def edited(analysis: Analysis, at: int, **changes: Any) -> Analysis:
    shots = list(analysis.shots)
    shots[at] = replace(shots[at], **changes)
    return replace(analysis, shots=tuple(shots))


def names(first: int, last: int) -> set[str]:
    return {f"scene.{n:04d}.exr" for n in range(first, last + 1)}


def test_what_it_finds(found: Analysis) -> None:
    assert [(s.first, s.last) for s in found.shots] == SHOTS
    assert found.cuts == (18, 19)
    assert found.keyframes == (1, 6, 11, 16, 17, 18, 19, 21, 26, 30)
    assert (found.frames, len(found.times_s)) == (30, 30)
    assert found.times_s[0] == 0
    means = [s.statistics.mean for s in found.shots if s.statistics]
    assert means == sorted(means), "the scenes get brighter"
    for shot in found.shots:
        s = shot.statistics
        assert s is not None
        assert 0 <= s.p1 <= s.p50 <= s.p95 <= s.p99 <= s.maximum <= 1


def test_numbers_follow_the_start_number(clip: Path) -> None:
    found = analyse(clip, SETTINGS, start_number=1001)
    assert found.cuts == (1018, 1019)
    assert found.shots[-1].last == 1030


def test_bars_and_clipped_share(tmp_path: Path) -> None:
    codes = np.full((64, 96, 3), 100, np.uint8)
    codes[:12] = codes[-8:] = 3
    codes[:, :4] = 0
    codes[12:22, 4:14] = 255
    found = analyse(write_ffv1(tmp_path / "bars.mkv", [codes] * 3))
    assert found.bars == Bars(left=4, right=0, top=12, bottom=8)
    assert found.statistics.clipped == pytest.approx(100 / (64 * 96), abs=1e-6)
    assert found.statistics.maximum == pytest.approx(1)
    assert found.statistics.change == 0
    assert "key_interval" in {s.setting for s in found.suggestions}, "a still needs fewer keys"


def test_all_black_has_no_bars(tmp_path: Path) -> None:
    found = analyse(write_ffv1(tmp_path / "black.mkv", [np.zeros((64, 96, 3), np.uint8)] * 2))
    assert found.bars == Bars()
    assert found.statistics.p99 == 0


def test_the_file_comes_back(found: Analysis, tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text(found.to_json())
    back = read_analysis(path)
    assert back == found
    assert back.where == str(path)


BAD_SHOTS = [
    ({"peak_nit": 600}, "unknown peak_nit"),
    ({"strength": 1.5}, "from 0 to 1"),
    ({"strength": "high"}, "must be a number"),
    ({"enabled": 1}, "true or false"),
    ({"peak_nits": 600, "l_max": 3}, "exclude"),
    ({"first": 20}, "ends before"),
    ({"last": 18}, "overlaps"),
    ({"last": True}, "whole number"),
    ({"first": 0}, "before frame 1"),
    ({"statistics": {"mean": 1}}, "missing"),
]


@pytest.mark.parametrize(("change", "words"), BAD_SHOTS)
def test_a_wrong_shot_is_named(found: Analysis, change: dict[str, Any], words: str) -> None:
    data = json.loads(found.to_json())
    data["shots"][0] |= change
    with pytest.raises(InputError) as caught:
        parse_analysis(json.dumps(data), where="a.json")
    assert words in str(caught.value)
    assert caught.value.where == "a.json"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"itmo_video_analysis": 2}, "format is 2"),
        ({"shots": {}}, "list"),
        ({"shots": [3]}, "not a table"),
        ({"cuts": [900]}, "no frame"),
        ({"times_s": ["1/0"]}, "no time"),
        ({"digest": 7}, "text"),
        ({"frames": -1}, "whole number"),
        ({"bars": None}, "not a table"),
        ({"more": 1}, "unknown more"),
        ({"suggestions": [{"setting": "a", "value": [], "reason": "b"}]}, "value"),
    ],
)
def test_a_wrong_file_is_refused(found: Analysis, change: dict[str, Any], words: str) -> None:
    data = json.loads(found.to_json()) | change
    with pytest.raises(InputError, match="not a valid analysis") as caught:
        parse_analysis(json.dumps(data), where="a.json")
    assert words in str(caught.value)


@pytest.mark.parametrize("text", ["", "{", "[]", "null", "[" * 99999, '{"a": NaN}', "\ud800"])
def test_other_files_are_refused(text: str) -> None:
    with pytest.raises(InputError):
        parse_analysis(text, where="a.json")


def test_unedited_it_changes_nothing(
    clip: Path, found: Analysis, plain: dict[str, bytes], tmp_path: Path
) -> None:
    convert(clip, tmp_path, SETTINGS, RunOptions(analysis=found))
    assert all_bytes(tmp_path) == plain


def test_only_the_edited_shot_is_made_again(
    clip: Path, found: Analysis, plain: dict[str, bytes], tmp_path: Path
) -> None:
    convert(clip, tmp_path / "out", SETTINGS)
    other = edited(found, 2, peak_nits=400.0)
    with pytest.raises(OutputError, match="--update"):
        convert(clip, tmp_path / "out", SETTINGS, RunOptions(analysis=other))
    summary = convert(clip, tmp_path / "out", SETTINGS, RunOptions(analysis=other, update=True))
    assert summary.written == 12, "one shot has 12 frames, no others may be rendered"
    made = exr_bytes(tmp_path / "out")
    assert {n for n in made if made[n] != plain[n]} == names(19, 30)

    settings = replace(SETTINGS, peak_nits=400.0)
    convert(clip, tmp_path / "all", settings, RunOptions(frames="19-30"))
    alone = exr_bytes(tmp_path / "all")
    assert alone == {n: made[n] for n in names(19, 30)}, "not what that peak gives"

    ranged = RunOptions(frames="15-22", analysis=other)
    convert(clip, tmp_path / "ranged", SETTINGS, ranged)
    assert exr_bytes(tmp_path / "ranged") == {n: made[n] for n in names(15, 22)}, "the law"

    again = convert(clip, tmp_path / "out", SETTINGS, RunOptions(analysis=found, update=True))
    assert again.written == 12, "taking the edit back renders that shot only, too"
    assert all_bytes(tmp_path / "out") == plain


def test_off_and_strength(clip: Path, found: Analysis, tmp_path: Path) -> None:
    def rgb(folder: str, number: int) -> np.ndarray:
        image = read_exr(tmp_path / folder / f"scene.{number:04d}.exr")
        return np.stack([image.channels[c] for c in "RGB"]).astype(np.float64)

    linear = make_settings("default", operator="linear", lights=64, radius=64, expand_map=False)
    variants = {
        "full": found,
        "half": edited(found, 2, strength=0.5),
        "none": edited(found, 2, strength=0.0),
        "off": edited(found, 2, enabled=False, peak_nits=4000.0),
    }
    for name, analysis in variants.items():
        run = RunOptions(frames="19,30,10", analysis=analysis)
        convert(clip, tmp_path / name, linear, run)
    assert exr_bytes(tmp_path / "off") == exr_bytes(tmp_path / "none")
    full, half, none = (rgb(name, 30) for name in ("full", "half", "none"))
    assert none.max() <= 1, "a shot that is off stays SDR"
    np.testing.assert_allclose(full, none * linear.l_max_effective, rtol=2e-3)
    np.testing.assert_allclose(half, (full + none) / 2, rtol=2e-3)
    assert (rgb("off", 10) == rgb("full", 10)).all(), "a shot's settings reach another shot"


def test_another_clips_analysis_and_values_out_of_bounds(
    clip: Path, found: Analysis, tmp_path: Path
) -> None:
    with pytest.raises(UsageError, match="another clip"):
        convert(clip, tmp_path, SETTINGS, RunOptions(analysis=replace(found, digest="0")))
    low = edited(found, 0, peak_nits=10.0)
    with pytest.raises(UsageError, match="shot 1-17: peak-nits 10 is below"):
        convert(clip, tmp_path, SETTINGS, RunOptions(analysis=low))
    assert list(tmp_path.iterdir()) == []


def test_shots_may_be_cut_by_hand(clip: Path, found: Analysis, tmp_path: Path) -> None:
    other = replace(found, shots=(Shot(3, 4, l_max=2.0), Shot(9, 9, strength=0.0)))
    convert(clip, tmp_path, SETTINGS)
    summary = convert(clip, tmp_path, SETTINGS, RunOptions(analysis=other, update=True))
    assert summary.written == 3


def test_at_the_command_line(clip: Path, tmp_path: Path) -> None:
    file = tmp_path / "a.json"
    done = run("analyse", clip, "--output", file)
    assert done.returncode == 0, done.stderr
    assert "3 shots" in done.stdout
    assert run("analyse", clip, "--output", file).returncode == 5, "edited by hand, perhaps"
    assert parse_analysis(run("analyse", clip).stdout, where="-") == read_analysis(file)
    file.write_text(file.read_text().replace('"strength": 1.0', '"strength": 2', 1))
    done = run("convert", clip, tmp_path / "out", "--analysis", file)
    assert (done.returncode, "shot 1-17: strength" in done.stderr) == (3, True), done.stderr


def _suggested(clipped: float, p50: float) -> dict[str, Any]:
    statistics = Statistics(0.3, 0.0, p50, 0.9, 1.0, 1.0, clipped, 0.01)
    found = suggestions(ClipInfo(**CLIP_FACTS), statistics)
    assert all(s.reason for s in found)
    make_settings("default", **{s.setting: s.value for s in found})  # raises out of bounds
    return {s.setting: s.value for s in found}


@pytest.mark.parametrize(
    ("clipped", "p50", "expected"),
    [
        (0.03, 0.08, {}),
        (0.03, 0.02, {"peak_nits": 600}),
        (0.0001, 0.08, {"radius": 16, "min_lights": 4}),
        (0.08, 0.02, {"peak_nits": 600, "min_lights": 4}),
        (0.03, 0.4, {"radius": 8}),
        (0.03, 0.2, {"radius": 8, "l_white": 12}),
    ],
)
def test_what_the_statistics_suggest(
    clipped: float, p50: float, expected: dict[str, float]
) -> None:
    assert _suggested(clipped, p50) == expected


CLIP_FACTS: dict[str, Any] = {
    "path": "/nowhere.mkv", "stem": "nowhere", "container": "matroska", "codec": "ffv1",
    "pixel_format": "bgr0", "width": 96, "height": 64, "frames": 24, "frame_rate": Fraction(24),
    "duration_s": Fraction(1), "is_vfr": False, "pixel_aspect": Fraction(1), "rotation_deg": 0,
    "flip": False, "field_order": "progressive", "timecode": None, "digest": "0",
    "encoding": Encoding("rgb", 8, "bt709", "full", "srgb", "rec709"),
}  # fmt: skip
