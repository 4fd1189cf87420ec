"""analyse: what it finds, and what its file may hold."""

from __future__ import annotations

import json
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from analysis_settings import SETTINGS
from clips import still_encoding, write_ffv1
from command import run

from itmo_video import analyse, make_settings, read_analysis
from itmo_video.analysis.model import Analysis, Bars, Statistics
from itmo_video.analysis.reading import parse_analysis
from itmo_video.analysis.suggestions import suggestions
from itmo_video.errors import UsageError
from itmo_video.model import ClipInfo
from itmo_video.settings import Settings

SHOTS = [(1, 17), (18, 18), (19, 30)]


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
    "encoding": still_encoding(),
}  # fmt: skip
