"""A conversion that leaves everything as it was says so, with the reason."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from clips import moving_scene, write_ffv1

from itmo_video import RunOptions, convert, make_settings
from itmo_video.events import Event, Warned


@pytest.mark.parametrize(
    ("preset", "settings", "told"),
    [
        (
            "paper",
            {"lights": 64, "radius": 1.0},
            "nowhere are --min-lights (4) of the --lights (64)",
        ),
        ("paper", {"lights": 16, "radius": 64.0}, None),
        ("paper", {"l_max": 1.1}, "the maximum is 1.1 times SDR white"),
        ("paper", {"l_max": 1.1, "strength": 0.0}, None),
        ("default", {"peak_nits": 203.0}, "the maximum is 1 times SDR white; raise --peak-nits"),
        ("default", {"peak_nits": 203.0, "footage": "clipped", "expand_map": False}, None),
        ("paper", {"operator": "linear", "l_max": 1.0}, None),
    ],
)
def test_why(tmp_path: Path, preset: str, settings: dict[str, Any], told: str | None) -> None:
    clip = write_ffv1(tmp_path / "clip.mkv", moving_scene(2, width=96, height=64))
    events: list[Event] = []
    run = RunOptions(frames="1", null=True)
    convert(clip, tmp_path / "out", make_settings(preset, **settings), run, events.append)
    said = [e.message for e in events if isinstance(e, Warned) and "expanded" in e.message]
    assert [told in text for text in said] == [True] if told else said == []
