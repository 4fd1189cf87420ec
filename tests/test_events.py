"""--json: one line an event, for machines; nothing else on standard output."""

from __future__ import annotations

import json
from pathlib import Path

from command import run

CLIP = Path(__file__).parents[1] / "sample_clips" / "night_street.mp4"
FLAGS = ("--lights", 64, "--json", "--quiet")


def test_one_line_an_event(tmp_path: Path) -> None:
    done = run("convert", CLIP, tmp_path, *FLAGS, "--frames", "1-4")
    assert (done.returncode, done.stderr) == (0, "")
    events = [json.loads(line) for line in done.stdout.splitlines()]
    kinds = [event["event"] for event in events if event["event"] != "warning"]
    assert kinds == ["started", *["frame"] * 4, "finished"]
    frames = [event for event in events if event["event"] == "frame"]
    assert sorted(event["number"] for event in frames) == [1, 2, 3, 4]
    assert [(event["done"], event["of"]) for event in frames] == [(n, 4) for n in range(1, 5)]
    summary = events[-1]
    assert (summary["wanted"], summary["written"], summary["present"]) == (4, 4, 0)
    assert summary["bytes_written"] == sum(p.stat().st_size for p in tmp_path.glob("*.exr"))

    again = run("convert", CLIP, tmp_path, *FLAGS, "--frames", "1-5").stdout.splitlines()
    summary = json.loads(again[-1])
    assert (summary["wanted"], summary["written"], summary["present"]) == (5, 1, 4)
