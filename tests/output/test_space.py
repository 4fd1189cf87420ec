"""Space on the disk: the estimate holds for real frames, and a warning comes before the start."""

from __future__ import annotations

from pathlib import Path

import pytest
from clips import SAMPLES

from itmo_video import RunOptions, convert, make_settings
from itmo_video.compressions import WRITTEN as COMPRESSIONS
from itmo_video.conversion import checking
from itmo_video.events import Event, Warned
from itmo_video.output import disk_space

CLIP = SAMPLES / "night_street.mp4"


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_a_real_frame_takes_about_as_much(compression: str, tmp_path: Path) -> None:
    settings = make_settings("default", lights=64, compression=compression)
    summary = convert(CLIP, tmp_path, settings, RunOptions(frames="1-2"))
    estimated = 2 * disk_space.estimated_frame_bytes(480, 270, False, settings)
    assert 0.6 * estimated <= summary.bytes_written <= 1.02 * estimated


def test_layers_and_alpha_count() -> None:
    plain, layered = make_settings(), make_settings(layers=("gain", "expand_map"))
    three, five = (disk_space.estimated_frame_bytes(1000, 1000, False, s) for s in (plain, layered))
    assert five / three == pytest.approx(5 / 3, rel=0.01)
    assert disk_space.estimated_frame_bytes(9, 9, True, plain) > disk_space.estimated_frame_bytes(
        9, 9, False, plain
    )


def test_a_warning_where_it_will_not_fit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(disk_space, "free_bytes", lambda path: 10_000_000)
    settings, run = make_settings(), RunOptions(frames="1-3")
    assert "warning" not in checking.describe_plan(CLIP, tmp_path, settings, run)
    planned = checking.describe_plan(CLIP, tmp_path, settings, RunOptions())
    assert "warning: about 30 MB needed, 10 MB free" in planned

    monkeypatch.setattr(disk_space, "free_bytes", lambda path: 1_000_000)
    events: list[Event] = []
    convert(CLIP, tmp_path, settings, run, events.append)
    warnings = [e.message for e in events if isinstance(e, Warned)]
    assert any("1.0 MB free" in w and "to resume" in w for w in warnings), warnings
    convert(CLIP, tmp_path, settings, run, events.append)
    more = [e.message for e in events if isinstance(e, Warned)][len(warnings) :]
    assert not any("free" in w for w in more), "nothing is left to be made: nothing is needed"
