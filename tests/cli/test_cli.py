"""The command line is a contract: exit codes, words, nothing overwritten."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from clips import SAMPLES, SHARED, moving_scene, write_ffv1, write_noise

from itmo_video.cli.main import _parser, main
from itmo_video.cli.outcome import interrupted
from itmo_video.cli.parser_facts import commands_of


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_ffv1(tmp_path_factory.mktemp("clip") / "scene.mkv", moving_scene(6))


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        (["--l-max", "0.5"], "l-max must be from 1 to"),
        (["--lights", "1000"], "power of two"),
        (["--key-interval", "0"], "key-interval must be from 1 to 60"),
        (["--operator", "nope"], "unknown operator"),
        (["--preset", "nope"], "unknown preset"),
        (["--l-max", "5", "--peak-nits", "900"], "cannot be combined"),
        (["--layers", "nope"], "unknown nope"),
        (["--frames", "5-900"], "not in the clip"),
        (["--frames", "abc"], "not a frame range"),
        (["--compression", "lzw"], "invalid choice"),
        (["--jobs", "0"], "jobs must be from 1 to 4096"),
        (["--nonsense"], "unrecognized"),
        (["--peak_nits", "600"], "Did you mean --peak-nits? See `itmo-video convert --help`"),
        (["--peak-nits", "100"], "below white-nits"),
        (["--operator-param", "x"], "NAME=VALUE"),
        (["--radius", "nan"], "radius must be"),
    ],
)
def test_wrong_usage_is_exit_2_and_makes_nothing(
    clip: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], flags: list[str], words: str
) -> None:
    out = tmp_path / "out"
    assert main(["convert", str(clip), str(out), *flags]) == 2
    assert words in capsys.readouterr().err
    assert not out.exists(), "nothing may be made when the settings are wrong"


def test_a_sequence_expanded_by_the_shell_is_asked_for_as_a_pattern(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["preview", "a.01.png", "a.02.png", "a.03.png", "film.mp4"]) == 2
    said = capsys.readouterr().err
    assert "too many arguments, from a.03.png on" in said
    assert "by its pattern, such as img.%04d.png" in said


def test_a_missing_input_is_exit_3(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["convert", str(tmp_path / "no.mp4"), str(tmp_path / "out")]) == 3
    assert "no such file" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_folder_with_other_files_is_refused_and_untouched(clip: Path, tmp_path: Path) -> None:
    theirs = tmp_path / "scene.0001.exr"
    theirs.write_bytes(b"theirs")
    assert main(["convert", str(clip), str(tmp_path)]) == 5
    assert [p.name for p in tmp_path.iterdir()] == ["scene.0001.exr"]
    assert theirs.read_bytes() == b"theirs", "a user's file was overwritten"


def test_other_settings_are_refused_and_update_makes_them_again(clip: Path, tmp_path: Path) -> None:
    assert main(["convert", str(clip), str(tmp_path / "o")]) == 0
    before = (tmp_path / "o" / "scene.0001.exr").read_bytes()
    flags = ["--l-max", "7"]
    assert main(["convert", str(clip), str(tmp_path / "o"), *flags]) == 5
    assert (tmp_path / "o" / "scene.0001.exr").read_bytes() == before
    assert main(["convert", str(clip), str(tmp_path / "o"), *flags, "--verify"]) == 7
    assert main(["convert", str(clip), str(tmp_path / "o"), *flags, "--update"]) == 0
    assert main(["convert", str(clip), str(tmp_path / "o"), *flags, "--verify"]) == 0


def test_another_source_is_refused(clip: Path, tmp_path: Path) -> None:
    other = write_ffv1(tmp_path / "scene.mkv", moving_scene(3, seed=9))
    assert main(["convert", str(clip), str(tmp_path / "o")]) == 0
    assert main(["convert", str(other), str(tmp_path / "o")]) == 5


def test_a_dry_run_of_null_refuses_no_folder(tmp_path: Path) -> None:
    """As --null itself, which writes nothing, whatever the folder holds."""
    clip = write_ffv1(tmp_path / "c.mkv", moving_scene(2, width=64, height=48))
    line = ["convert", str(clip), str(tmp_path / "o"), "--lights", "16", "--quiet"]
    assert main(line) == 0
    for more, code in (([], 5), (["--null"], 0)):
        for dry in ([], ["--dry-run"]):
            assert main([*line, "--peak-nits", "600", *more, *dry]) == code, (more, dry)


def test_dry_run_writes_nothing_and_tells(
    clip: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["convert", str(clip), str(tmp_path / "o"), "--dry-run"]) == 0
    told = capsys.readouterr().out
    assert "6 frames (1-6)" in told
    assert "MB of memory" in told
    assert not (tmp_path / "o").exists()


def test_null_writes_nothing(clip: Path, tmp_path: Path) -> None:
    assert main(["convert", str(clip), str(tmp_path / "o"), "--null", "--quiet"]) == 0
    assert not (tmp_path / "o").exists()


def test_json_is_one_event_a_line(
    clip: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["convert", str(clip), str(tmp_path / "o"), "--json", "--quiet"]) == 0
    events = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    kinds = [event["event"] for event in events]
    assert kinds.count("frame") == 6
    assert "started" in kinds
    assert kinds[-1] == "finished"


def test_the_small_commands_tell(clip: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", str(clip), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["frames"], told["width"], told["height"]) == (6, 96, 64)
    assert told["transfer"] == {"value": "srgb", "from": "assumed"}
    assert told["rendering"]["from"].startswith("the first frame")
    assert main(["analyse", str(clip), "--quiet"]) == 0
    kinds = ("as by a camera", "tone-mapped", "nothing reaches white")
    (kind,) = (kind for kind in kinds if kind in told["rendering"]["value"])
    assert kind in capsys.readouterr().out, "of one shot both say the same"
    for command in ("presets", "operators"):
        assert main([command]) == 0
        assert "banterle2006" in capsys.readouterr().out
    assert main([]) == 0


def test_unexpected_errors_show_no_traceback(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def broken(*args: object) -> None:
        raise RuntimeError("boom")

    monkeypatch.setattr("itmo_video.presets.preset_names", broken)
    assert main(["presets"]) == 1
    err = capsys.readouterr().err
    assert "boom" in err
    assert "Traceback" not in err


@pytest.mark.shared
@pytest.mark.parametrize("name", ["carphone_pristine.mp4", "nasa_13013.mp4", "chaplin.mp4"])
def test_real_clips_give_a_file_a_frame(tmp_path: Path, name: str) -> None:
    assert main(["convert", str(SHARED / "data/clips" / name), str(tmp_path / "o"), "--quiet"]) == 0
    main(["info", str(SHARED / "data/clips" / name)])
    count = len(list((tmp_path / "o").glob("*.exr")))
    assert count == {"carphone_pristine.mp4": 120, "nasa_13013.mp4": 325, "chaplin.mp4": 241}[name]


def test_help_answers_at_once_without_the_heavy_modules() -> None:
    code = (
        "import sys\nfrom itmo_video.cli.main import main\n"
        "try: main(['convert', '--help'])\nexcept SystemExit: pass\n"
        "print([m for m in ('cv2', 'av', 'scipy', 'OpenEXR') if m in sys.modules])"
    )
    out = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60
    )
    assert out.stdout.splitlines()[-1] == "[]"
    assert "examples:" in out.stdout


def test_help_fits_a_terminal_of_80_columns_and_its_usage_one_line(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    for command in commands_of(_parser()):
        with pytest.raises(SystemExit):
            main([command.name, "--help"])
        lines = capsys.readouterr().out.splitlines()
        assert [line for line in lines if len(line) > 80] == []
        assert lines[0].endswith(command.usage), lines[0]
        assert not lines[1], lines[1]
        assert all(text for _, text in command.arguments), command.name


@pytest.mark.parametrize("name", ["night_street", "bright_window", "cut_and_flash"])
def test_sample_clips_convert(tmp_path: Path, name: str) -> None:
    flags = ["--quiet", "--frames", "18-24"]
    assert main(["convert", str(SAMPLES / f"{name}.mp4"), str(tmp_path / "o"), *flags]) == 0
    assert len(list((tmp_path / "o").glob("*.exr"))) == 7


def test_of_several_inputs_each_gets_its_own_folder(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    a = write_ffv1(tmp_path / "a.mkv", moving_scene(2))
    b = write_ffv1(tmp_path / "b.mkv", moving_scene(3, seed=4))
    bad = tmp_path / "bad.mkv"
    bad.write_bytes(b"not a video")
    out = tmp_path / "out"
    assert main(["convert", str(a), str(bad), str(b), str(out)]) == 3
    *_, before, last = capsys.readouterr().err.splitlines()
    assert before.startswith(f"itmo-video: 3 of 3: {out / 'b'}/: 3 frames rendered")
    assert last == f"itmo-video: 1 of 3 inputs had errors: {bad} (exit code 3)"
    assert len(list((out / "a").glob("a.*.exr"))) == 2
    assert len(list((out / "b").glob("b.*.exr"))) == 3, "a bad input kept the next from being made"
    assert main(["convert", str(a), str(a), str(out), "--quiet"]) == 2


def test_damage_is_reported_again_when_the_command_is_run_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    clip = write_noise(tmp_path / "a.avi", "mpeg4", 12, seed=3)
    data = bytearray(clip.read_bytes())
    at = data.index(b"movi") + (len(data) - data.index(b"movi")) // 2
    data[at : at + 400] = np.random.default_rng(4).bytes(400)
    clip.write_bytes(data)
    said, numbers = [], []
    for _ in range(2):
        assert main(["convert", str(clip), str(tmp_path / "out")]) == 4
        said.append(capsys.readouterr().err)
        numbers.append(re.findall(r"frames (\S+) are damaged in the source", said[-1]))
    assert "0 frames rendered, 12 already present" in said[1]
    assert len(numbers[0]) == 1
    assert numbers[0] == numbers[1]
    assert main(["convert", str(clip), str(tmp_path / "out"), "--verify"]) == 0


def test_verify_names_runs_of_frames_in_a_line(
    clip: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["convert", str(clip), str(out), "--quiet", "--frames", "1-3"]) == 0
    (out / "scene.0001.exr").write_bytes(b"")
    capsys.readouterr()
    assert main(["convert", str(clip), str(out), "--verify"]) == 7
    told = capsys.readouterr().err
    assert "scene.0001.exr: damaged" in told
    assert "frames 4-6: missing" in told
    assert "without --verify" in told


@pytest.mark.parametrize(("command", "words"), [("convert", "resume"), ("preview", "not finished")])
def test_an_interrupted_command_says_what_stands(
    capsys: pytest.CaptureFixture[str], command: str, words: str
) -> None:
    assert interrupted(130, [command]) == 130
    assert words in capsys.readouterr().err


def test_info_says_what_it_cannot_show(
    clip: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["info", "-"]) == 2
    assert "a pipe can be read only once" in capsys.readouterr().err
    assert main(["convert", str(clip), str(tmp_path / "out"), "--frames", "1", "--quiet"]) == 0
    assert main(["info", str(tmp_path / "out")]) == 3
    assert "is a converted folder, not a clip" in capsys.readouterr().err
