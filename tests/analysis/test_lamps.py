"""`lamps` without effect is said: footage that a camera clipped, or daylight up to 1."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from clips import write_ffv1

from itmo_video import RunOptions, analyse, convert, make_settings, read_exr
from itmo_video.events import Event, Warned


@pytest.fixture(scope="module")
def street(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small light below white on a grey wall, beside a window that clips."""
    frame = np.full((96, 144, 3), 95, np.uint8)
    frame[:, 60:64], frame[40:43, 100:103], frame[:48, :48] = 20, 225, 255
    return write_ffv1(tmp_path_factory.mktemp("clip") / "street.mkv", [frame] * 2)


def converted(clip: Path, out: Path, **settings: float | str) -> tuple[list[str], bytes]:
    """What is said of lamps, and the pixels of the first frame."""
    events: list[Event] = []
    convert(clip, out, make_settings("default", **settings), RunOptions(frames="1"), events.append)
    told = [event.message for event in events if isinstance(event, Warned)]
    image = read_exr(out / f"{clip.stem}.0001.exr")
    return [t for t in told if "lamps" in t], b"".join(image.channels[c].tobytes() for c in "RGB")


@pytest.mark.parametrize(
    ("lamps", "footage", "told"),
    [
        (2.0, "auto", "frame 1: it does not seem tone-mapped"),
        (2.0, "clipped", "lamps has no effect with these settings (operator auto, footage clipped"),
        (0.5, "tone-mapped", "frame 1: it is no night scene"),
        (2.0, "tone-mapped", None),
        (1.0, "auto", None),
    ],
)
def test_a_notice_where_it_changes_nothing(
    tmp_path: Path, street: Path, lamps: float, footage: str, told: str | None
) -> None:
    said, pixels = converted(street, tmp_path / "lamps", lamps=lamps, footage=footage)
    _, usual = converted(street, tmp_path / "usual", footage=footage)
    assert [told in text for text in said] == [True] if told else said == []
    assert (pixels == usual) == (told is not None or lamps == 1.0)


def test_one_notice_without_a_map(tmp_path: Path, street: Path) -> None:
    said, pixels = converted(
        street, tmp_path / "lamps", lamps=2.0, footage="tone-mapped", expand_map=False
    )
    assert said == [
        "footage, lamps have no effect with these settings (operator auto, no Expand Map)"
    ]
    assert pixels == converted(street, tmp_path / "usual", expand_map=False)[1]


def test_analyse_says_it_of_each_shot(street: Path) -> None:
    for lamps in (1.0, 2.0):
        (shot,) = analyse(street, make_settings("default", lamps=lamps)).shots
        assert str(shot.rendering).endswith("; lamps has no effect") == (lamps == 2.0)


def test_a_shot_of_its_own_is_named(tmp_path: Path, street: Path) -> None:
    found = analyse(street)
    for lamps, told in ((2.0, True), (1.0, False)):
        shot = dataclasses.replace(found.shots[0], own={"lamps": lamps})
        run = RunOptions(analysis=dataclasses.replace(found, shots=(shot,)))
        events: list[Event] = []
        convert(street, tmp_path / str(lamps), None, run, events.append)
        said = [event.message for event in events if isinstance(event, Warned)]
        assert any("lamps has no effect in shots like that of frame 1" in t for t in said) == told
