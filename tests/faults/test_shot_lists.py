"""Shot lists as people edit them: mistakes are wrong usage, named, and tell the remedy."""

from __future__ import annotations

import copy
import json
from dataclasses import replace
from pathlib import Path

import pytest
from clips import moving_scene, write_ffv1

from itmo_video import Analysis, UsageError, analyse, convert, read_analysis
from itmo_video.analysis.reading import parse_analysis
from itmo_video.cli.main import main
from itmo_video.conversion.run_options import RunOptions


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_ffv1(
        tmp_path_factory.mktemp("clip") / "c.mkv", moving_scene(40, width=64, height=48, cuts=(20,))
    )


@pytest.fixture(scope="module")
def found(clip: Path) -> Analysis:
    return analyse(clip)


def test_a_mistake_is_wrong_usage_wherever_it_is(
    clip: Path, found: Analysis, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text, path = found.to_json(), tmp_path / "a.json"
    shot = '{"first": 1, "last": 20, "enabled": true'
    assert shot in text
    for was, now, told in (
        (shot, f'{shot}, "strength": 3', "shot 1-20: strength"),
        (shot, f'{shot}, "l_max": 3, "l-max": 4', "l_max is given twice"),
        (shot, f'{shot}, "l_max": 3, "l_max": 4', "'l_max' is given twice"),
        (shot, f'{shot}, "lamps": 1, "colour": 1', "unknown colour"),
        (shot, f'{shot}, "l_max": 3, "peak_nits": 4', "cannot be combined"),
        (shot, f'{shot}, "peak_nits": 100', "peak-nits 100 is below white-nits"),
        (shot, f'{shot}, "compression": "zip"', "compression"),
        ('"frames": 40', '"frames": 39', "goes beyond"),
        (found.digest, "0" * 32, "of another clip"),
        ("}", "", "not JSON"),
    ):
        path.write_text(text.replace(was, now))
        assert main(["convert", str(clip), str(tmp_path / "o"), "--analysis", str(path)]) == 2, told
        error = capsys.readouterr().err
        assert told in error
        assert str(path) in error
    line = ["convert", str(clip), str(tmp_path / "o"), "--analysis", str(tmp_path / "none.json")]
    assert main(line) == 2
    assert not (tmp_path / "o").exists()


def test_a_byte_order_mark_is_no_mistake(found: Analysis, tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text(found.to_json(), encoding="utf-8-sig")
    assert read_analysis(path) == found
    (tmp_path / "p.toml").write_text("[settings]\nstrength = 0.5\n", encoding="utf-8-sig")
    assert main(["presets"]) in (0, 2)


def test_the_file_says_how_it_is_edited(found: Analysis) -> None:
    assert '"enabled": false leaves it SDR' in json.loads(found.to_json())["read_me"]
    assert parse_analysis(found.to_json(), where="-") == found


def test_a_changed_shot_is_told_by_its_frames(
    clip: Path, found: Analysis, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first, second = found.shots
    for strength, code in ((0.5, 0), (0.4, 5)):
        edited = replace(found, shots=(first, replace(second, own={"strength": strength})))
        (tmp_path / "a.json").write_text(edited.to_json())
        line = ["convert", str(clip), str(tmp_path / "o"), "--analysis", str(tmp_path / "a.json")]
        assert main([*line, "--frames", "1-2", "--lights", "16"]) == code
    assert "with other settings (shots of frames 21-40)" in capsys.readouterr().err


def test_a_range_is_looked_at_as_the_whole_is(clip: Path, found: Analysis) -> None:
    part = analyse(clip, frames=range(11, 31))
    assert [(shot.first, shot.last) for shot in part.shots] == [(11, 20), (21, 30)]
    assert part.cuts == found.cuts == (21,)
    assert part.keyframes == tuple(n for n in found.keyframes if 11 <= n <= 30)
    assert (part.frames, len(part.times_s)) == (40, 20)
    assert [s.first for s in analyse(clip, frames=[5, 6, 9]).shots] == [5, 9]
    assert analyse(clip, frames=range(1, 41)) == found
    with pytest.raises(UsageError, match="frame 41 is not in the clip"):
        analyse(clip, frames=[41])
    assert parse_analysis(part.to_json(), where="-") == part


def test_frames_of_analyse_at_the_command_line(
    clip: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "a.json"
    line = ["analyse", str(clip), "--output", str(path), "--frames", "1-10", "--quiet"]
    assert main(line) == 0
    told = capsys.readouterr().out
    assert "at 99 % of white" in told
    assert "% clipped;" not in told
    shots = read_analysis(path).shots
    assert [(shot.first, shot.last) for shot in shots] == [(1, 10)]
    run = RunOptions(frames="9-12", analysis=read_analysis(path))
    assert convert(clip, tmp_path / "o", run=run).written == 4


def test_a_mistyped_setting_is_told_with_its_shot(found: Analysis) -> None:
    told = json.loads(found.to_json())
    for name, hint in (("strenght", "did you mean strength?"), ("xyzzy", "known are first, last")):
        wrong = copy.deepcopy(told)
        wrong["shots"][1][name] = 0.5
        with pytest.raises(UsageError, match=f"shot 21-40: unknown {name}; ") as caught:
            parse_analysis(json.dumps(wrong), where="-")
        assert hint in str(caught.value)
