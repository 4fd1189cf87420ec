"""Users' operators, found by entry point."""

from __future__ import annotations

from importlib import metadata
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from clips import moving_scene, write_ffv1

from itmo_video import RunOptions, convert
from itmo_video.errors import OutputError, UsageError
from itmo_video.operators import (
    OPERATORS,
    Context,
    LuminanceOperator,
    all_operators,
    find_operator,
    gain_of,
    version_of,
)
from itmo_video.presets import make_settings
from itmo_video.settings import Settings


class _Point:
    name, value = "doubled", "somewhere:operator"

    def __init__(self, thing: object, version: str | None = None) -> None:
        self.thing = thing
        self.dist = None if version is None else SimpleNamespace(name="mine", version=version)

    def load(self) -> object:
        if isinstance(self.thing, Exception):
            raise self.thing
        return self.thing


def _install(monkeypatch: pytest.MonkeyPatch, thing: object, version: str | None = None) -> None:
    points = [_Point(thing, version)]
    monkeypatch.setattr(
        metadata,
        "entry_points",
        lambda group, name=None: [p for p in points if name in (None, p.name)],
    )


def test_users_operators_are_found_by_entry_point(monkeypatch: pytest.MonkeyPatch) -> None:
    mine = LuminanceOperator("doubled", "twice", "mine", gain_of(lambda y, _: 2 * y))
    _install(monkeypatch, mine)
    assert find_operator(Settings(operator="doubled")) is mine
    assert set(all_operators()) == set(OPERATORS) | {"doubled"}
    assert (mine.gain(np.ones((2, 2), np.float32), Context(5, 5)) == 2).all()


def test_a_users_operators_version_is_part_of_the_fingerprint(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    clip, out = tmp_path / "clip.mkv", tmp_path / "out"
    write_ffv1(clip, moving_scene(2))
    mine = LuminanceOperator("doubled", "twice", "mine", gain_of(lambda y, _: 2 * y))
    _install(monkeypatch, mine, "1.0")
    settings = make_settings("default", operator="doubled")
    assert convert(clip, out, settings).written == 2
    assert convert(clip, out, settings).present == 2, "the same version is not found again"
    _install(monkeypatch, mine, "1.1")
    with pytest.raises(OutputError, match="other settings"):
        convert(clip, out, settings)
    assert convert(clip, out, settings, RunOptions(update=True)).written == 2
    assert version_of("doubled") == "mine 1.1"
    assert version_of("linear") == "", "a built-in operator's fingerprint would move"


@pytest.mark.parametrize("thing", [ImportError("no such module"), "not an operator"])
def test_a_broken_entry_point_is_told(monkeypatch: pytest.MonkeyPatch, thing: object) -> None:
    _install(monkeypatch, thing)
    with pytest.raises(UsageError, match="doubled"):
        find_operator(Settings(operator="doubled"))
    assert find_operator(Settings(operator="linear")).name == "linear"
