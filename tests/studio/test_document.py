"""What is decided: settings and shots, undone and redone, and saved so that `convert` agrees."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from itmo_video import make_settings, read_analysis
from itmo_video.errors import OutputError, UsageError
from itmo_video.source.opening import open_clip
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
    plain_name,
    preset_toml,
)


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
