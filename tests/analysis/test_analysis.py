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
from itmo_video.cli.main import main
from itmo_video.delivery.from_clip import from_clip
from itmo_video.delivery.pictures import Picture
from itmo_video.errors import OutputError, UsageError
from itmo_video.events import Warned
from itmo_video.model import ClipInfo, Encoding
from itmo_video.settings import Settings

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
    enabled = changes.pop("enabled", True)
    shots[at] = replace(shots[at], own=changes, enabled=enabled)
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
    ({"strength": 2.5}, "from 0 to 2"),
    ({"strength": "high"}, "must be a number"),
    ({"key-interval": 0}, "from 1 to 60"),
    ({"operator": 7}, "operator must be"),
    ({"preset": "of nobody"}, "unknown preset"),
    ({"fps": "12"}, "unknown fps"),
    ({"primaries": "rec2020"}, "unknown primaries"),
    ({"enabled": 1}, "true or false"),
    ({"peak_nits": 600, "l_max": 3}, "cannot be combined"),
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
    with pytest.raises(UsageError) as caught:
        parse_analysis(json.dumps(data), where="a.json")
    assert words in str(caught.value)
    assert caught.value.where == "a.json"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"itmo_video_analysis": 3}, "format is 3"),
        ({"shots": {}}, "list"),
        ({"shots": [3]}, "not a table"),
        ({"cuts": [900]}, "not a frame"),
        ({"times_s": ["1/0"]}, "not a time"),
        ({"digest": 7}, "text"),
        ({"frames": -1}, "whole number"),
        ({"bars": None}, "not a table"),
        ({"more": 1}, "unknown more"),
        ({"suggestions": [{"setting": "a", "value": [], "reason": "b"}]}, "value"),
    ],
)
def test_a_wrong_file_is_refused(found: Analysis, change: dict[str, Any], words: str) -> None:
    data = json.loads(found.to_json()) | change
    with pytest.raises(UsageError, match="not a valid analysis") as caught:
        parse_analysis(json.dumps(data), where="a.json")
    assert words in str(caught.value)


@pytest.mark.parametrize("text", ["", "{", "[]", "null", "[" * 99999, '{"a": NaN}', "\ud800"])
def test_other_files_are_refused(text: str) -> None:
    with pytest.raises(UsageError):
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
    other = replace(found, shots=(Shot(3, 4, {"l_max": 2.0}), Shot(9, 9, enabled=False)))
    convert(clip, tmp_path, SETTINGS)
    summary = convert(clip, tmp_path, SETTINGS, RunOptions(analysis=other, update=True))
    assert summary.written == 3


@pytest.mark.parametrize(
    "own",
    [
        {"strength": 1.0},
        {"operator": "reinhard2002"},
        {"preset": "paper", "peak_nits": 600.0},
        {"radius": 20.0, "min_lights": 2, "soft_lights": False},
        {"key_interval": 3, "smooth_keys": 1, "map_width": 48},
        {"temporal": "per-frame"},
        {"expand_map": False, "l_max": 3.0},
    ],
)
def test_a_shot_means_what_the_command_line_means(
    clip: Path, found: Analysis, tmp_path: Path, own: dict[str, Any]
) -> None:
    """Frames of a shot are those of a clip converted with its settings, cut there or not."""
    flags = {"lights": 64, "compression": "none", "peak_nits": 700.0}
    shots = (Shot(1, 11), Shot(12, 22, own), Shot(23, 30, enabled=False))
    analysis = replace(found, shots=shots)
    convert(clip, tmp_path / "shots", make_settings(**flags), RunOptions(analysis=analysis, jobs=3))
    of_clip = {n: v for n, v in flags.items() if n != "peak_nits" or "l_max" not in own}
    whole = make_settings(**{"preset": "default"} | of_clip | own)
    convert(clip, tmp_path / "whole", whole, RunOptions(frames="12-22"))
    made, alone = exr_bytes(tmp_path / "shots"), exr_bytes(tmp_path / "whole")
    assert [n for n in names(12, 22) if made[n] != alone[n]] == []

    ranged = RunOptions(frames="10-13", analysis=analysis)
    convert(clip, tmp_path / "ranged", make_settings(**flags), ranged)
    again = exr_bytes(tmp_path / "ranged")
    assert all(again[n] == made[n] for n in names(10, 13)), "the law"
    convert(clip, tmp_path / "base", make_settings(**flags), RunOptions(frames="1-11"))
    base = exr_bytes(tmp_path / "base")
    assert all(base[n] == made[n] for n in names(1, 11)), "a shot's settings reach another shot"


def test_settings_that_no_preset_was_asked_for_are_all_meant(found: Analysis) -> None:
    base = Settings(strength=0.5, peak_nits=600.0, operator="linear")
    assert Shot(1, 2, {"radius": 9.0}).settings(base) == replace(base, radius=9.0)
    paper = Shot(1, 2, {"preset": "paper"}).settings(base)
    assert paper == make_settings("paper", strength=0.5, peak_nits=600.0, operator="linear")
    white = make_settings(white_nits=100.0, peak_nits=150.0)
    assert Shot(1, 2, {"preset": "paper"}).settings(white).white_nits == 100
    with pytest.raises(UsageError, match="whole clip"):
        Shot(1, 2, {"compression": "rle"}).settings(base)


def test_frames_in_no_shot_are_told(clip: Path, found: Analysis, tmp_path: Path) -> None:
    told: list[Any] = []
    other = replace(found, shots=(Shot(1, 17), Shot(20, 29)), where="a.json")
    run = RunOptions(frames="15-22,30", analysis=other)
    convert(clip, tmp_path / "o", SETTINGS, run, told.append)
    warnings = [event.message for event in told if isinstance(event, Warned)]
    assert any("frames 18-19,30 are in no shot of a.json" in text for text in warnings)
    told.clear()
    convert(clip, tmp_path / "p", SETTINGS, RunOptions(frames="15-17", analysis=other), told.append)
    assert not any("no shot" in str(event) for event in told)


def test_an_analysis_at_another_rate_is_refused(
    clip: Path, found: Analysis, tmp_path: Path
) -> None:
    slower = replace(SETTINGS, fps="12")
    with pytest.raises(UsageError, match="has 30 frames, this conversion has 15"):
        convert(clip, tmp_path / "o", slower, RunOptions(analysis=found))


def test_format_1_is_read_where_it_means_the_same(found: Analysis) -> None:
    data = json.loads(found.to_json())
    data["itmo_video_analysis"] = 1
    for shot in data["shots"]:
        shot |= {"peak_nits": None, "l_max": None, "strength": 1.0}
    data["shots"][1]["peak_nits"] = 500
    back = parse_analysis(json.dumps(data), where="a.json")
    assert [shot.own for shot in back.shots] == [{}, {"peak_nits": 500}, {}]
    data["shots"][2]["strength"] = 0.5
    with pytest.raises(UsageError, match=r"shot 19-30: strength 0\.5 is from format 1"):
        parse_analysis(json.dumps(data), where="a.json")


def test_a_preview_shows_the_shots(clip: Path, found: Analysis, tmp_path: Path) -> None:
    other = edited(found, 2, preset="paper", peak_nits=4000.0, strength=1.0)
    run = RunOptions(analysis=other, jobs=2)
    convert(clip, tmp_path, SETTINGS, run)
    pictures = from_clip(clip, SETTINGS, run)
    assert pictures.peak_nits == 4000

    def is_same(picture: Picture) -> bool:
        image = read_exr(tmp_path / f"scene.{picture.number:04d}.exr")
        return all(
            bool((image.channels[c] == p).all()) for c, p in zip("RGB", picture.rgb, strict=True)
        )

    assert list(pictures.mapped(is_same)) == [True] * 30


def test_a_folder_takes_no_settings(clip: Path, found: Analysis, tmp_path: Path) -> None:
    convert(clip, tmp_path / "o", SETTINGS)
    for more in (["--peak-nits", "500"], ["--preset", "paper"]):
        assert main(["preview", str(tmp_path / "o"), str(tmp_path / "a.mp4"), *more]) == 2
    assert not (tmp_path / "a.mp4").exists()


def test_at_the_command_line(clip: Path, tmp_path: Path) -> None:
    file = tmp_path / "a.json"
    done = run("analyse", clip, "--output", file)
    assert done.returncode == 0, done.stderr
    assert "3 shots" in done.stdout
    assert run("analyse", clip, "--output", file).returncode == 5, "edited by hand, perhaps"
    assert parse_analysis(run("analyse", clip).stdout, where="-") == read_analysis(file)
    file.write_text(file.read_text().replace('"enabled": true', '"strength": 3', 1))
    done = run("convert", clip, tmp_path / "out", "--analysis", file)
    assert (done.returncode, "shot 1-17: strength" in done.stderr) == (2, True), done.stderr


def _suggested(clipped: float, p50: float, settings: Settings) -> dict[str, Any]:
    statistics = Statistics(0.3, 0.0, p50, 0.9, 1.0, 1.0, clipped, 0.01)
    found = suggestions(ClipInfo(**CLIP_FACTS), statistics, settings)
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
    maps = {"operator": "banterle2006", "radius": 12.0, "min_lights": 2}
    assert _suggested(clipped, p50, make_settings("default", **maps)) == expected
    has_them = make_settings("default", **{**maps, **expected})
    assert _suggested(clipped, p50, has_them) == {}, "suggested what is set already"
    assert _suggested(clipped, p50, make_settings("default")) == {}, "another operator's"


CLIP_FACTS: dict[str, Any] = {
    "path": "/nowhere.mkv", "stem": "nowhere", "container": "matroska", "codec": "ffv1",
    "pixel_format": "bgr0", "width": 96, "height": 64, "frames": 24, "frame_rate": Fraction(24),
    "duration_s": Fraction(1), "is_vfr": False, "pixel_aspect": Fraction(1), "rotation_deg": 0,
    "flip": False, "field_order": "progressive", "timecode": None, "digest": "0",
    "encoding": Encoding("rgb", 8, "bt709", "full", "srgb", "rec709"),
}  # fmt: skip
