"""One definition an option: what the command line refuses, the library refuses in its words."""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path
from typing import Any

import pytest
from clips import moving_scene, write_ffv1

from itmo_video.cli.main import _parser, main
from itmo_video.cli.option_flags import add_options, options_of
from itmo_video.conversion.run_options import RunOptions
from itmo_video.delivery import sdr
from itmo_video.delivery.preview_options import PreviewOptions
from itmo_video.errors import UsageError
from itmo_video.evaluation.evaluate_options import EvaluateOptions
from itmo_video.html_report.report_options import ReportOptions
from itmo_video.options import flag_of, option, spec_of
from itmo_video.presets import make_settings
from itmo_video.settings import Settings

KINDS = {
    "convert": (Settings, RunOptions),
    "preview": (Settings, PreviewOptions),
    "evaluate": (EvaluateOptions,),
    "report": (ReportOptions,),
}
SETS = [(command, kind) for command, kinds in KINDS.items() for kind in kinds]


def made(kind: type[Any], **values: Any) -> Any:
    needed = {"source": Path("c.mp4")} if kind is EvaluateOptions else {}
    return kind(**needed | values)


def help_of(command: str) -> argparse.ArgumentParser:
    subparsers = next(a for a in _parser()._actions if isinstance(a.choices, dict))
    found = dict(subparsers.choices or {})[command]
    assert isinstance(found, argparse.ArgumentParser)
    return found


@pytest.mark.parametrize(("command", "kind"), SETS)
def test_each_option_is_a_flag_with_help_and_a_default_that_it_accepts(
    command: str, kind: type[Any]
) -> None:
    flags = {flag: a for a in help_of(command)._actions for flag in a.option_strings}
    for f in dataclasses.fields(kind):
        spec, action = spec_of(f), flags[f"--{flag_of(f)}"]
        assert spec.help.replace("%", "%%") in str(action.help)
        value = getattr(made(kind), f.name)
        if value is not None:
            assert spec.check(f.name, value) == value


@pytest.mark.parametrize(("command", "kind"), SETS)
def test_what_is_out_of_bounds_is_refused_when_the_options_are_made(
    command: str, kind: type[Any]
) -> None:
    for f in dataclasses.fields(kind):
        spec = spec_of(f)
        wrong: list[object] = [object()]
        wrong += [spec.kind(spec.lower - 1)] if spec.lower is not None else []
        wrong += [spec.kind(spec.upper * 2 + 1)] if spec.upper is not None else []
        wrong += ["nonsense"] if spec.choices else []
        wrong += [True] if spec.kind in (int, float) else []
        for value in wrong:
            with pytest.raises(UsageError, match=flag_of(f)):
                made(kind, **{f.name: value})


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["convert", "{clip}", "{out}", "--jobs", "-1"], "jobs must be from 1 to 4096"),
        (["convert", "{clip}", "{out}", "--start-number", "-5"], "start-number must be 0 or more"),
        (["convert", "{clip}", "{out}", "--max-pixels", "0"], "max-pixels must be 1 or more"),
        (["preview", "{clip}", "{out}.mp4", "--jobs", "-3"], "jobs must be from 1 to 4096"),
        (["preview", "{clip}", "{out}.mp4", "--start-number", "-5"], "start-number must be 0"),
        (["preview", "{clip}", "{out}.mp4", "--max-pixels", "-1"], "max-pixels must be 1"),
        (["preview", "{clip}", "{out}.mp4", "--crf", "64"], "crf must be from 0 to 63"),
        (["preview", "{clip}", "{out}.mp4", "--crf", "nan"], "crf must be from 0 to 63"),
        (["preview", "{clip}", "{out}.mp4", "--wipe-at", "1.5"], "wipe-at must be from 0 to 1"),
        (["preview", "{clip}", "{out}.png", "--frame", "-1"], "frame must be 0 or more"),
        (["analyse", "{clip}", "--start-number", "-1"], "start-number must be 0 or more"),
        (["analyse", "{clip}", "--max-pixels", "0"], "max-pixels must be 1 or more"),
        (["evaluate", "{out}", "--source", "{clip}", "--key-interval", "0"], "key-interval"),
        (["evaluate", "{out}", "--source", "{clip}", "--white-nits", "inf"], "white-nits must be"),
        (["evaluate", "{out}"], "nothing to compare with"),
    ],
)
def test_commands_refuse_it_with_exit_2_and_make_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], words: str
) -> None:
    clip = write_ffv1(tmp_path / "clip.mkv", moving_scene(2))
    names = {"clip": clip, "out": tmp_path / "made"}
    assert main([text.format(**names) for text in arguments]) == 2
    assert words in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == [clip]


def test_a_preset_with_both_maxima_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    preset = tmp_path / "mine.toml"
    preset.write_text("[settings]\nl-max = 8.0\npeak-nits = 500.0\n")
    assert main(["convert", "clip.mp4", str(tmp_path / "o"), "--preset", str(preset)]) == 2
    assert f"{preset}: l-max and peak-nits cannot be combined" in capsys.readouterr().err
    with pytest.raises(UsageError, match="cannot be combined"):
        make_settings(str(preset), l_max=3.0)  # the file is at fault, whatever overrides it


def test_what_the_help_calls_the_default_is_what_happens(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(SystemExit):
        main(["convert", "--help"])
    told = " ".join(capsys.readouterr().out.split())
    happens = make_settings()
    for f in dataclasses.fields(Settings):
        value, text = getattr(happens, f.name), " ".join(spec_of(f).help.split())
        if isinstance(value, int | float) and not isinstance(value, bool):
            assert f"{text}; {spec_of(f).bounds_in_words} ({value:.10g})" in told
        elif isinstance(value, str):
            assert f"{text} ({value})" in told
    assert "SET_" not in told
    assert "." not in told.split("--operator ")[1].split()[0], "a field's name is shown to users"


def test_flags_and_keywords_give_the_same_options() -> None:
    parser = help_of("preview")
    flags = "--as compare --crf high --source c.mp4 --jobs 3 --in-hdr --frames 1-2"
    args = parser.parse_args(["a", "b", *flags.split()])
    assert options_of(args, PreviewOptions) == PreviewOptions(
        view="compare", crf="high", clip=Path("c.mp4"), hdr_compare=True
    )
    assert options_of(args, RunOptions) == RunOptions(jobs=3, frames="1-2")
    assert options_of(parser.parse_args(["a", "b"]), PreviewOptions) == PreviewOptions()
    assert parser.parse_args(["a", "b", "--quality", "3"]) == parser.parse_args(
        ["a", "b", "--crf", "3"]
    )


def test_the_tone_maps_on_offer_are_those_that_there_are() -> None:
    field = next(f for f in dataclasses.fields(PreviewOptions) if f.name == "tone_map")
    assert set(spec_of(field).choices) == set(sdr.TONE_MAPS)


def test_paths_may_be_text() -> None:
    assert ReportOptions(clip="c.mp4").clip == Path("c.mp4")  # type: ignore[arg-type]


@dataclasses.dataclass(frozen=True)
class _Checks:
    limits: dict[str, float] = option({}, dict, "limits", metavar="NAME=VALUE")


def test_named_numbers_are_gathered() -> None:
    parser = argparse.ArgumentParser()
    add_options(parser, _Checks)
    args = parser.parse_args(["--limits", "a=1", "--limits", "b=2.5"])
    assert options_of(args, _Checks).limits == {"a": 1, "b": 2.5}
    with pytest.raises(UsageError, match="NAME=VALUE"):
        options_of(parser.parse_args(["--limits", "a"]), _Checks)


@pytest.mark.parametrize("value", [10**400, -(10**400)])
def test_numbers_too_long_for_a_float_are_refused(value: int) -> None:
    with pytest.raises(UsageError, match="l-max must be from 1 to 60000"):
        make_settings(l_max=value)


def test_more_jobs_than_a_machine_can_have_are_refused() -> None:
    with pytest.raises(UsageError, match="jobs must be from 1 to 4096"):
        RunOptions(jobs=2**63)
