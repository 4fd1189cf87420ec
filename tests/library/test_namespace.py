"""What `import itmo_video` offers: each name once, at once, with an example that runs."""

from __future__ import annotations

import ast
import doctest
import importlib.metadata
import inspect
import subprocess
import sys
from pathlib import Path

import cv2
import pytest
from clips import moving_scene, write_ffv1

import itmo_video

NAMES = [name for name in itmo_video.__all__ if name != "__version__"]
TOLD = ("Event", "Started", "FrameDone", "Warned", "Finished")  # events have no use of their own
WITH_EXAMPLE = [n for n in NAMES if n not in TOLD and (n == "ItmoError" or n[-5:] != "Error")]


def test_the_table_and_the_imports_for_type_checkers_are_the_same() -> None:
    tree = ast.parse(Path(itmo_video.__file__).read_text("utf-8"))
    block = next(node for node in tree.body if isinstance(node, ast.If))
    told = {
        alias.asname: f"{node.module}.{alias.name}"
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert told == {name: f"itmo_video.{room}.{name}" for name, room in itmo_video._HOMES.items()}


def test_each_name_is_there_and_offered() -> None:
    for name in NAMES:
        assert getattr(itmo_video, name) is not None
    assert set(itmo_video.__all__) <= set(dir(itmo_video))
    assert not [name for name in dir(itmo_video) if name.startswith("_") and name[1] != "_"]
    assert itmo_video.__version__ == importlib.metadata.version("itmo_video")
    with pytest.raises(AttributeError, match="no attribute 'nope'"):
        itmo_video.nope  # noqa: B018


def test_no_room_has_the_name_of_something_in_it() -> None:
    root = Path(itmo_video.__file__).parent
    rooms = {p.name for p in root.iterdir() if p.is_dir()} | {p.stem for p in root.glob("*.py")}
    assert not rooms & set(NAMES), "importing the room would put it in the name's place"


def test_importing_it_imports_nothing_heavy() -> None:
    code = (
        "import itmo_video, sys; dir(itmo_video); from itmo_video import Settings, RunOptions;"
        "print([m for m in ('numpy', 'cv2', 'av', 'scipy', 'OpenEXR') if m in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60
    )
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("name", WITH_EXAMPLE)
def test_it_has_an_example_that_runs(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write_ffv1(Path("clip.mkv"), moving_scene(3))
    cv2.imwrite("photo.png", next(iter(moving_scene(1)))[..., ::-1])
    found = getattr(itmo_video, name)
    test = doctest.DocTestParser().get_doctest(inspect.getdoc(found) or "", {}, name, None, 0)
    assert test.examples, f"{name} has no example"
    failed = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(test)
    assert failed.failed == 0
