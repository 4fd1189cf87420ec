"""Config file, log, --verbose, colour, the bar: told, never in the way of what is made."""

from __future__ import annotations

import io
import json
import os
import re
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from clips import exr_bytes, moving_scene, write_ffv1

from itmo_video.cli.log_file import LogFile
from itmo_video.cli.main import main
from itmo_video.cli.progress import Progress, bar_line
from itmo_video.cli.terminal import named
from itmo_video.conversion.written_frames import peak_of
from itmo_video.errors import InputError, OutputError, UsageError
from itmo_video.output.exr import read_exr
from itmo_video.presets import make_settings


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_ffv1(tmp_path_factory.mktemp("clip") / "c.mkv", moving_scene(2))


@pytest.fixture
def config(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "cfg"))
    (tmp_path / "cfg" / "itmo-video").mkdir(parents=True)
    return tmp_path / "cfg" / "itmo-video" / "config.toml"


def settings_in(folder: Path) -> dict[str, object]:
    found = json.loads((folder / "itmo-video.json").read_text())["settings"]
    assert isinstance(found, dict)
    return found


def converted(clip: Path, out: Path, *flags: str) -> dict[str, bytes]:
    assert main(["convert", str(clip), str(out), *flags]) == 0
    return exr_bytes(out)


def test_a_config_is_flags_given_before_and_is_told(
    clip: Path, tmp_path: Path, config: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config.write_text("[settings]\npeak-nits = 600\nkey_interval = 2\n[run]\njobs = 1\n")
    by_config = converted(clip, tmp_path / "a")
    assert f"from {config}: peak-nits 600.0, key-interval 2, jobs 1" in capsys.readouterr().err
    by_flags = converted(
        clip, tmp_path / "b", "--no-config", "--peak-nits", "600", "--key-interval", "2"
    )
    assert str(config) not in capsys.readouterr().err
    assert by_config == by_flags, "the law: the bytes are those of the effective settings"
    assert settings_in(tmp_path / "a") == settings_in(tmp_path / "b")
    assert settings_in(tmp_path / "a")["peak_nits"] == 600


def test_flags_win_and_a_preset_that_is_named_is_to_the_letter(
    clip: Path, tmp_path: Path, config: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config.write_text('preset = "ibl"\n[settings]\npeak-nits = 600\n')
    converted(clip, tmp_path / "a", "--l-max", "3")
    held = settings_in(tmp_path / "a")
    assert held["l_max"] == 3, "a flag replaces its counterpart of the config"
    assert f"from {config}: preset ibl (" in capsys.readouterr().err
    converted(clip, tmp_path / "b", "--preset", "paper")
    plain = make_settings("paper").as_dict()
    assert {n: v for n, v in settings_in(tmp_path / "b").items() if n in plain} == json.loads(
        json.dumps(plain)
    )
    assert str(config) not in capsys.readouterr().err


def test_a_folders_preview_has_no_settings_from_a_config(
    clip: Path, tmp_path: Path, config: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    converted(clip, tmp_path / "out", "--no-config")
    config.write_text('[settings]\npeak-nits = 600\n[preview]\nas = "sdr"\n')
    assert main(["preview", str(tmp_path / "out"), str(tmp_path / "f.y4m")]) == 0
    assert f"from {config}: as sdr (" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[settings]\nno-such = 1\n", "[settings] has no no-such"),
        ("[run]\noverwrite = true\n", "[run] has no overwrite"),
        ("[preview]\nframe = 3\n", "[preview] has no frame"),
        ("[settings]\npeak-nits = -1\n", "peak-nits must be"),
        ("[settings]\nl-max = 3\npeak-nits = 600\n", "cannot be combined"),
        ("nonsense = 1\n", "unknown entry nonsense"),
        ('preset = "nope"\n', "unknown preset 'nope'"),
        ("preset = 3\n", "preset must be text"),
        ("[run\n", "config file"),
    ],
)
def test_a_wrong_config_is_refused_by_its_name(
    clip: Path, tmp_path: Path, config: Path, capsys: pytest.CaptureFixture[str], text: str,
    words: str,
) -> None:  # fmt: skip
    config.write_text(text)
    assert main(["convert", str(clip), str(tmp_path / "o")]) == UsageError.exit_code
    told = capsys.readouterr().err
    assert words in told
    assert str(config) in told
    assert not (tmp_path / "o").exists()


def test_a_home_of_somebody_elses_does_not_end_the_work(
    clip: Path, tmp_path: Path, config: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    def denied(path: Path) -> None:
        raise InputError("cannot be read", where=str(path)) from PermissionError(13, "denied")

    monkeypatch.setattr("itmo_video.cli.config_file.read_toml", denied)
    assert main(["convert", str(clip), str(tmp_path / "o"), "--dry-run"]) == 0
    assert "permission denied; config file ignored" in capsys.readouterr().err


def test_quiet_and_json_say_nothing_of_it_on_standard_output(
    clip: Path, tmp_path: Path, config: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config.write_text("[run]\njobs = 1\n")
    assert main(["convert", str(clip), str(tmp_path / "o"), "--json", "--quiet"]) == 0
    told = capsys.readouterr()
    assert all(json.loads(line) for line in told.out.splitlines())
    assert told.err == ""


def test_the_log_has_all_runs_with_times(clip: Path, tmp_path: Path) -> None:
    log = tmp_path / "run.log"
    flags = ["--log", str(log), "--quiet"]
    assert main(["convert", str(clip), str(tmp_path / "o"), *flags]) == 0
    assert main(["convert", str(clip), str(tmp_path / "o"), "--peak-nits", "400", *flags]) == 5
    lines = log.read_text().splitlines()
    at = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z ")
    assert all(at.match(line) for line in lines)
    told = [at.sub("", line) for line in lines]
    assert sum(line.startswith("itmo-video ") for line in told) == 2
    assert f"{clip} to {tmp_path / 'o'}: 2 frames" in told
    assert {"frame 1: 1 of 2", "frame 2: 1 of 2"} & set(told)
    assert any(line.startswith("settings: ") and "peak-nits=400" in line for line in told)
    assert [line for line in told if line.startswith("exit code")] == ["exit code 0", "exit code 5"]
    assert "--update" in "".join(told), "errors are in the log"
    assert any(re.search(r"o: 2 frames rendered, peak \d+ nits, ", line) for line in told)


def test_the_log_never_writes_into_a_users_file(
    clip: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = clip.read_bytes()
    for path in (clip, tmp_path):
        code = main(["convert", str(clip), str(tmp_path / "o"), "--log", str(path)])
        assert code == OutputError.exit_code
    assert clip.read_bytes() == before
    notes = tmp_path / "notes.txt"
    notes.write_text("2026 was a good year\n")
    with pytest.raises(OutputError, match="not a log"):
        LogFile(notes)
    assert "Choose another name" in capsys.readouterr().err


def test_a_log_whose_disk_is_full_is_told_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(descriptor: int, data: Sequence[int]) -> int:
        raise OSError(28, "No space left on device")

    with closing(LogFile(tmp_path / "a.log")) as log:
        monkeypatch.setattr(os, "write", full)
        log.write("one")
        log.write("two")
        monkeypatch.undo()
    assert capsys.readouterr().err.count("the log cannot be written") == 1


def test_verbose_tells_settings_and_frames(
    clip: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["convert", str(clip), str(tmp_path / "o"), "--verbose"]) == 0
    told = capsys.readouterr().err
    assert "itmo-video: settings: operator=auto, " in told
    assert "itmo-video: frame 2: " in told
    assert main(["convert", str(clip), str(tmp_path / "o"), "--verbose", "--quiet"]) == 2


def test_the_last_line_has_folder_frames_peak_and_time(
    clip: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "o"
    assert main(["convert", str(clip), str(out)]) == 0
    last = capsys.readouterr().err.splitlines()[-1]
    found = re.fullmatch(
        r"itmo-video: (.*): 2 frames rendered, peak (\d+) nits, [\d.]+ s, [1-9]\d* kB", last
    )
    assert found is not None, last
    largest = max(
        float(read_exr(path).channels[c].max()) for path in out.glob("*.exr") for c in "RGB"
    )
    assert (found[1], int(found[2])) == (str(out), round(largest * 203))
    assert main(["convert", str(clip), str(out)]) == 0
    last = capsys.readouterr().err.splitlines()[-1]
    assert "0 frames rendered, 2 already present, " in last, "nothing was made: no peak"
    (out / f"{clip.stem}.0002.exr").unlink()
    assert main(["convert", str(clip), str(out)]) == 0
    last = capsys.readouterr().err.splitlines()[-1]
    assert re.search(r": 1 frame rendered \(peak \d+ nits\), 1 already present, ", last), last


def test_the_peak_is_that_of_halves() -> None:
    plane = np.array([[-3.0, 0.5], [0.0, -0.0]], np.float16)
    big = np.array([[4.92, 0.1]], np.float16)
    assert peak_of((plane, plane, plane)) == 0.5
    assert peak_of((plane, big, plane)) == np.float16(4.92)
    assert peak_of((-np.abs(plane),) * 3) == 0


class _Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_colour_is_for_terminals_and_not_where_it_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name in ("NO_COLOR", "TERM"):
        monkeypatch.delenv(name, raising=False)
    assert named("x", _Terminal(), "red") == "\x1b[1;31mitmo-video:\x1b[0m x"
    assert named("x", io.StringIO(), "red") == "itmo-video: x"
    monkeypatch.setenv("NO_COLOR", "1")
    assert named("x", _Terminal(), "red") == "itmo-video: x"
    monkeypatch.setenv("NO_COLOR", "")  # the convention: empty is not set
    assert "\x1b" in named("x", _Terminal(), "red")
    monkeypatch.setenv("TERM", "dumb")
    assert "\x1b" not in named("x", _Terminal(), "red")


def test_an_error_stands_on_a_line_of_its_own(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stream = _Terminal()
    with (
        pytest.raises(ZeroDivisionError),
        Progress(as_json=False, quiet=False, stream=stream).on("clip.mp4"),
    ):
        raise ZeroDivisionError
    assert stream.getvalue() == "\ropening clip.mp4\n"
    quiet = _Terminal()
    with Progress(as_json=False, quiet=True, stream=quiet).on("clip.mp4"):
        pass
    assert quiet.getvalue() == ""


def test_the_bar_names_the_input_and_fits() -> None:
    assert bar_line("c.mp4", 12, 48, 2.0, 79) == (
        "c.mp4 [######------------------] 12/48 frames, 6.0 fps, 0:06 left"
    )
    assert bar_line("c.mp4", 0, 48, 0.0, 79) == "c.mp4 [------------------------] 0/48 frames"
    assert bar_line("stdin", 12, 0, 2.0, 79) == "stdin 12 frames, 6.0 fps"
    assert "1:00:00 left" in bar_line("c.mp4", 1, 3601, 1.0, 79)
    for columns in range(80):
        line = bar_line("a name that is longer than a terminal.mp4", 7, 100000, 3.0, columns)
        assert len(line) <= columns
