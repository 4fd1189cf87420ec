"""What is decided: settings and shots, undone and redone, and saved so that `convert` agrees."""

from __future__ import annotations

import dataclasses
import os
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from clips import moving_scene, write_ffv1

from itmo_video import analyse, make_settings, read_analysis
from itmo_video.cli.main import _parser
from itmo_video.cli.option_flags import given
from itmo_video.cli.parser_facts import commands_of
from itmo_video.conversion.run_options import RunOptions
from itmo_video.errors import OutputError, UsageError
from itmo_video.options import Spec, flag_of, spec_of
from itmo_video.settings import Settings
from itmo_video.source.opening import open_clip
from itmo_video.studio.desk import Desk
from itmo_video.studio.document import (
    Document,
    History,
    enable,
    merge,
    set_values,
    split,
    with_preset,
)
from itmo_video.studio.saving import (
    ExistsError,
    Saver,
    _flag,
    command,
    plain_name,
    preset_toml,
)
from itmo_video.studio.studio_options import StudioOptions


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("studio") / "scene.mkv"
    return write_ffv1(path, moving_scene(14, width=96, height=64, cuts=(8,)))


@pytest.fixture(scope="module")
def document(clip: Path) -> Document:
    return Document("default", {}, analyse(clip))


def spans(document: Document) -> list[tuple[int, int]]:
    return [(shot.first, shot.last) for shot in document.shots]


def test_shots_are_split_and_merged(document: Document) -> None:
    assert spans(document) == [(1, 8), (9, 14)]
    three = split(document, 4)
    assert spans(three) == [(1, 3), (4, 8), (9, 14)]
    assert spans(merge(three, 1)) == [(1, 3), (4, 14)]
    with pytest.raises(UsageError):
        split(document, 9)
    with pytest.raises(UsageError):
        merge(document, 1)


def test_a_shot_has_its_own_settings(document: Document, clip: Path) -> None:
    changed = enable(set_values(document, {"peak_nits": 400.0}, 1), 0, False)
    with open_clip(clip) as opened:
        info = opened.info
    assert changed.look_at(9, info).settings.l_max_effective == pytest.approx(400 / 203)
    assert changed.look_at(3, info).settings.strength == 0
    assert document.look_at(9, info) == document.look
    reset = set_values(changed, {"peak_nits": None}, 1)
    assert reset.look_at(9, info) == reset.look


def test_undo_and_redo(document: Document, clip: Path) -> None:
    with open_clip(clip) as opened:
        info = opened.info
    history = History(document)
    for step, nits in enumerate((500.0, 600.0, 700.0)):
        changed = set_values(history.now, {"peak_nits": nits}, None)
        history.do(changed, info, "drag" if step else None)
    history.undo()
    assert history.now.changed == {"peak_nits": 500.0}, "a drag is one step"
    history.undo()
    assert history.now is document
    assert not history.can_undo
    history.redo()
    history.redo()
    assert history.now.changed == {"peak_nits": 700.0}
    with pytest.raises(UsageError):
        history.do(set_values(history.now, {"radius": -1.0}, None), info)
    assert history.now.changed == {"peak_nits": 700.0}, "what was refused stays undone"


@pytest.mark.parametrize("preset", ["default", "paper", "ibl"])
@pytest.mark.parametrize(
    "values",
    [
        {},
        {"peak_nits": 1500.0},
        {"l_max": 7.0},
        {"operator": "reinhard2002", "strength": 0.75},
        {"operator": "drago2003", "operator_params": {}},
        {"expand_map": False, "layers": ["gain", "expand_map"], "lights": 256},
    ],
)
def test_a_saved_preset_is_what_was_decided(
    tmp_path: Path, preset: str, values: dict[str, Any]
) -> None:
    document = Document(preset, values)
    path = tmp_path / "look.toml"
    path.write_bytes(preset_toml(document))
    assert make_settings(str(path)) == document.settings


def test_a_preset_file_that_is_saved_over_is_still_what_it_was(tmp_path: Path) -> None:
    """Else undone changes come back in what is rendered: the page shows what was read at first."""
    path = tmp_path / "base.toml"
    path.write_text("[settings]\nstrength = 0.3\n")
    document = Document(str(path))
    changed = set_values(document, {"strength": 1.5}, None)
    path.write_bytes(preset_toml(changed))
    for now in (document, set_values(changed, {"strength": None}, None)):
        (tmp_path / "again.toml").write_bytes(preset_toml(now))
        assert make_settings(str(tmp_path / "again.toml")).strength == now.settings.strength == 0.3


def test_saved_shots_are_read_back(tmp_path: Path, document: Document) -> None:
    changed = set_values(split(document, 4), {"peak_nits": 400.0}, 1)
    path = Saver(tmp_path).save("shots", "list", changed, False)
    assert path.name == "list.json"
    assert read_analysis(path) == changed.analysis


def test_never_over_a_strangers_file(tmp_path: Path, document: Document) -> None:
    saver = Saver(tmp_path)
    (tmp_path / "a.toml").write_text("[project]\nname = 'x'\n")
    with pytest.raises(OutputError, match="not a preset"):
        saver.save("preset", "a", document, True)
    (tmp_path / "b.toml").write_bytes(preset_toml(Document("paper")))
    with pytest.raises(ExistsError):
        saver.save("preset", "b", document, False)
    saver.save("preset", "b", document, True)
    saver.save("preset", "b", set_values(document, {"strength": 0.5}, None), False)
    (tmp_path / "b.toml").write_bytes(preset_toml(Document("paper")))
    with pytest.raises(ExistsError):
        saver.save("preset", "b", document, False)
    (tmp_path / "c.json").symlink_to(tmp_path / "b.toml")
    with pytest.raises(OutputError):
        saver.save("shots", "c", document, True)
    assert (tmp_path / "a.toml").read_text().startswith("[project]")


@pytest.mark.parametrize("name", ["", "../x", "/etc/x", "a/b", ".hidden", "-rf", "a\nb", "a\0b"])
def test_names_are_no_paths(tmp_path: Path, document: Document, name: str) -> None:
    with pytest.raises(UsageError):
        Saver(tmp_path).save("preset", name, document, True)


def test_killed_in_mid_save_the_old_file_stands(tmp_path: Path) -> None:
    old = preset_toml(Document("paper"))
    (tmp_path / "look.toml").write_bytes(old)
    script = (
        "import os, signal\n"
        "from pathlib import Path\n"
        "from itmo_video.studio.document import Document\n"
        "from itmo_video.studio.saving import Saver\n"
        "os.replace = lambda *a: os.kill(os.getpid(), signal.SIGKILL)\n"
        f"Saver(Path({str(tmp_path)!r})).save('preset', 'look', Document('ibl'), True)\n"
    )
    ended = subprocess.run([sys.executable, "-c", script], env=os.environ, timeout=60)
    assert ended.returncode == -9
    assert (tmp_path / "look.toml").read_bytes() == old


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
        assert desk.preset_needs_saving
        saved = desk.save("preset", "look", False)
        assert f"--preset {saved}" in desk.command()
        assert not desk.preset_needs_saving
        saved.write_text("[settings]\nstrength = 1.1\n")
        assert "--preset PRESET.toml" in desk.command()


def test_a_names_suggestion_is_taken(tmp_path: Path) -> None:
    saver = Saver(tmp_path)
    for stem in ("a", "..x", "-x", "a/b:c", "\udce9", "\x07", "é" * 200, " ", "a\u2028b", "___"):
        assert saver.path(plain_name(stem), ".toml").parent == tmp_path
    for name in ("\ud800", "a\x7f", "é" * 130, "a\u2028b"):
        with pytest.raises(UsageError):
            saver.path(name)


def test_what_decides_the_frames_stays_as_opened(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text('[settings]\nfps = "24"\nstrength = 0.5\n')
    opened = Document(str(tmp_path / "mine.toml"), {"deinterlace": "off"})
    other = with_preset(opened, "paper", opened)
    assert (other.settings.fps, other.settings.deinterlace) == ("24", "off")
    (tmp_path / "mine.toml").unlink()
    back = with_preset(set_values(other, {"strength": 0.9}, None), opened.preset, opened)
    assert back.settings == opened.settings
    for values in ({"fps": "25"}, {"fps": None}, {"stream": 1}, {"raw": "x"}, {"preset": "x.toml"}):
        with pytest.raises(UsageError):
            set_values(opened, values, None)
    with pytest.raises(UsageError):
        with_preset(opened, str(tmp_path / "other.toml"), opened)


def test_an_error_names_the_file_that_was_asked_for(tmp_path: Path) -> None:
    with pytest.raises(OutputError) as told:
        Saver(tmp_path / "gone").save("preset", "look", Document("default"), False)
    assert told.value.where == str(tmp_path / "gone" / "look.toml")
