"""The command line that the studio shows makes what it shows."""

from __future__ import annotations

import dataclasses
import os
import shlex
import subprocess
from pathlib import Path
from typing import Any

import pytest

from itmo_video.cli.main import _parser
from itmo_video.cli.option_flags import given
from itmo_video.cli.parser_facts import commands_of
from itmo_video.conversion.run_options import RunOptions
from itmo_video.options import Spec, flag_of, spec_of
from itmo_video.settings import Settings
from itmo_video.studio.desk import Desk
from itmo_video.studio.document import (
    Document,
)
from itmo_video.studio.saving import (
    _flag,
    command,
)
from itmo_video.studio.studio_options import StudioOptions


def test_the_command_is_quoted() -> None:
    document = Document("paper", {"peak_nits": 400.0, "expand_map": False, "layers": ["gain"]})
    told = command(document, "a b'; rm.mp4", "out", None, Path("s.json"))
    assert told == (
        "itmo-video convert 'a b'\"'\"'; rm.mp4' out --preset paper --peak-nits 400 "
        "--no-expand-map --layers gain --analysis s.json"
    )
    film = command(Document("paper"), "a.mp4", "b.mp4", None, None, "preview")
    assert film == "itmo-video preview a.mp4 b.mp4 --preset paper"


def of_another_value(spec: Spec, default: Any) -> Any:
    if spec.kind is bool:
        return not default
    if spec.choices and spec.kind is not tuple:
        return next(name for name in spec.choices if name != default)
    if spec.kind in (int, float):
        return next(
            n for n in (4, 256, 300, 5000, 2, 0.5)
            if n != default and (spec.lower or 0) <= n <= (spec.upper or n)
        )  # fmt: skip
    return "other"


def test_the_command_has_every_option_that_the_studio_takes(tmp_path: Path) -> None:
    """Those of settings, and those of a run; where and how the page is served is the studio's."""
    parser = _parser()
    special = {"layers": "gain", "operator_params": {"key": 0.3}, "timecode": "01:00:00:00",
               "fps": "24000/1001", "operator": "drago2003"}  # fmt: skip
    commands = {command.name: command.flags for command in commands_of(parser)}
    own = {f"--{flag_of(f)}" for f in dataclasses.fields(StudioOptions)}
    own |= {"-h", "--no-config", "--preset", "--analysis"}
    taken = {flag.names[0] for flag in commands["studio"]} - own
    said: dict[str, Any] = {}
    for kind in (Settings, RunOptions):
        for f in dataclasses.fields(kind):
            if f"--{flag_of(f)}" not in taken:
                continue
            taken.remove(f"--{flag_of(f)}")
            said = {**said, f.name: special.get(f.name) or of_another_value(spec_of(f), f.default)}
    assert not taken, "options that are carried nowhere"
    assert "raw" not in said, "it is for pipes"
    flags = [word for name, value in said.items() for word in _flag(name, value)]
    asked = parser.parse_args(["studio", "clip.mp4", *flags])
    run = RunOptions(**given(asked, RunOptions))
    document = Document("default", given(asked, Settings))
    told = shlex.split(command(document, "clip.mp4", "out", None, None, run=run))
    again = parser.parse_args(told[1:])
    assert set(given(asked, Settings)) | set(given(asked, RunOptions)) == set(said)
    assert given(again, Settings) == given(asked, Settings)
    assert given(again, RunOptions) == given(asked, RunOptions)


def test_the_command_says_every_value_whole(tmp_path: Path) -> None:
    changed = {
        "l_max": 12.3456789, "strength": 0.1 + 0.2, "owner": "-x", "comments": "a\nb\x01'é",
        "operator_params": {"a": 1e-7}, "layers": [],
    }  # fmt: skip
    told = command(Document("default", changed), "-caf\udce9\\1.mp4", "out", None, None)
    printed = subprocess.run(
        ["bash", "-c", f"printf '%s\\0' {told}"], capture_output=True, check=True
    ).stdout
    assert [os.fsdecode(word) for word in printed.split(b"\0")[:-1]] == [
        "itmo-video", "convert", "-caf\udce9\\1.mp4", "out", "--preset", "default", "--l-max",
        "12.3456789", "--strength", "0.30000000000000004", "--owner=-x", "--comments",
        "a\nb\x01'é", "--operator-param=a=1e-07", "--layers=",
    ]  # fmt: skip


def test_the_command_names_the_presets_file_from_anywhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "mine.toml").write_text("[settings]\nstrength = 0.5\n")
    monkeypatch.chdir(tmp_path)
    told = command(Document("mine.toml"), "clip.mp4", "out", None, None)
    assert str(tmp_path / "mine.toml") in told


def test_the_command_names_no_file_that_says_something_else(clip: Path, tmp_path: Path) -> None:
    mine = tmp_path / "mine.toml"
    mine.write_text("[settings]\nstrength = 0.5\n")
    with Desk(clip, Document(str(mine)), tmp_path) as desk:
        assert f"--preset {mine}" in desk.command()
        mine.write_text("[settings]\nstrength = 0.9\n")
        assert "--preset PRESET.toml" in desk.command()
        first_needs = desk.preset_needs_saving
        saved = desk.save("preset", "look", False)
        assert f"--preset {saved}" in desk.command()
        assert (first_needs, desk.preset_needs_saving) == (True, False)
        saved.write_text("[settings]\nstrength = 1.1\n")
        assert "--preset PRESET.toml" in desk.command()
