"""Events: typed for who calls the library; one line each of --json, nothing else on stdout."""

from __future__ import annotations

import io
import json
from pathlib import Path

import pytest
from clips import SAMPLES, moving_scene, write_ffv1
from command import run

from itmo_video import EvaluateOptions, analyse, convert, evaluate
from itmo_video.cli.progress import Progress
from itmo_video.delivery.preview import preview
from itmo_video.events import Event, Finished, FrameDone, Started, Warned, as_json
from itmo_video.html_report.page import report

CLIP = SAMPLES / "night_street.mp4"
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


@pytest.mark.parametrize(
    ("event", "line"),
    [
        (
            Started("c.mp4", "out", 3, 1),
            {"event": "started", "input": "c.mp4", "output": "out", "frames": 3, "present": 1},
        ),
        (FrameDone(101, 2, 3), {"event": "frame", "number": 101, "done": 2, "of": 3}),
        (Warned("assumed"), {"event": "warning", "message": "assumed"}),
        (
            Finished(
                wanted=3, present=1, written=2, missing=[], damaged=[7], seconds=0.5,
                bytes_written=9,
            ),
            {
                "event": "finished", "wanted": 3, "present": 1, "written": 2, "missing": [],
                "damaged": [7], "seconds": 0.5, "bytes_written": 9,
            },
        ),
        (
            Finished(
                written=2, present=0, seconds=0.5, bytes_written=9, max_cll=900.0, max_fall=80.5
            ),
            {
                "event": "finished", "written": 2, "present": 0, "seconds": 0.5,
                "bytes_written": 9, "max_cll": 900.0, "max_fall": 80.5,
            },
        ),
    ],
)  # fmt: skip
def test_lines_are_what_they_were_when_events_were_dicts(
    event: Event, line: dict[str, object]
) -> None:
    assert as_json(event) == line
    json.dumps(as_json(event))


def test_each_command_tells_the_library_typed_events(tmp_path: Path) -> None:
    clip = write_ffv1(tmp_path / "clip.mkv", moving_scene(3))
    told: list[Event] = []
    convert(clip, tmp_path / "out", on_event=told.append)
    frames = [event for event in told if isinstance(event, FrameDone)]
    assert {event.number for event in frames} == {1, 2, 3}
    assert [(event.done, event.of) for event in frames] == [(1, 3), (2, 3), (3, 3)]
    assert Started(str(clip), str(tmp_path / "out"), 3, 0) in told
    assert isinstance(told[-1], Finished)
    assert (told[-1].wanted, told[-1].missing) == (3, [])

    told.clear()
    preview(clip, tmp_path / "film.mp4", on_event=told.append)
    kinds = [type(event) for event in told if not isinstance(event, Warned)]
    assert kinds == [Started, FrameDone, FrameDone, FrameDone, Finished]
    assert isinstance(told[-1], Finished)
    assert (told[-1].max_cll or 0) > 100

    told.clear()
    report(tmp_path / "out", on_event=told.append)
    assert [type(event) for event in told] == [Started, FrameDone, FrameDone, FrameDone]

    told.clear()
    analyse(clip, on_event=told.append)
    assert Warned in {type(event) for event in told}, "an untagged clip's encoding is assumed"
    assert [event for event in told if isinstance(event, FrameDone)] == [
        FrameDone(number, number, 3) for number in (1, 2, 3)
    ]

    told.clear()
    found = evaluate(tmp_path / "out", EvaluateOptions(source=clip), told.append)
    assert told == [FrameDone(number, number, 3) for number in (1, 2, 3)]
    assert (found.shots[0].first, found.shots[0].last) == (1, 3)


class _Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_terminal_has_one_line_of_progress_and_what_follows_stands_below(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("NO_COLOR", "1")
    stream = _Terminal()
    progress = Progress(as_json=False, quiet=False, stream=stream)
    with progress.on("films/clip.mp4") as on_event:
        on_event(Started("films/clip.mp4", "out/", 3, 0))
        on_event(FrameDone(1, 1, 3))
        on_event(Warned("frame 2 is damaged"))
        on_event(FrameDone(2, 2, 3))
        on_event(FrameDone(3, 3, 3))
        on_event(
            Finished(written=3, present=0, seconds=1.0, bytes_written=1_000_000, peak_nits=812.4)
        )
    lines = stream.getvalue().split("\n")
    assert lines[0].startswith("\ropening clip.mp4\rclip.mp4 [")
    assert "] 0/3 frames" in lines[0]
    assert lines[1] == "itmo-video: frame 2 is damaged"
    assert lines[2].startswith("\rclip.mp4 [########")
    assert "] 3/3 frames, " in lines[2]
    assert "-" not in lines[2].split("]")[0]
    assert lines[3:] == ["itmo-video: out/: 3 frames rendered, peak 812 nits, 1.0 s, 1.0 MB", ""]
    stream = _Terminal()
    several = Progress(as_json=False, quiet=False, stream=stream, about="-", place="2 of 4")
    with several.on("-") as on_event:
        on_event(Started("-", "-", 0, 0))
        on_event(Finished(written=3, present=0, seconds=1.0, bytes_written=1_000_000))
    first, last, _ = stream.getvalue().split("\n")
    assert first.startswith("\r2 of 4: opening standard input\r2 of 4: standard input 0 frames")
    assert last == "itmo-video: 2 of 4: standard output: 3 frames rendered, 1.0 s, 1.0 MB"
    piped = io.StringIO()
    Progress(as_json=False, quiet=False, stream=piped).on_event(FrameDone(1, 1, 3))
    assert piped.getvalue() == "", "progress is for terminals"


def test_an_input_that_fails_has_its_event(tmp_path: Path) -> None:
    (tmp_path / "bad.mp4").write_text("no film")
    done = run(
        "convert", tmp_path / "bad.mp4", CLIP, tmp_path / "out", *FLAGS, "--frames", "1",
    )  # fmt: skip
    assert done.returncode == 3
    events = [json.loads(line) for line in done.stdout.splitlines()]
    assert [e["event"] for e in events if e["event"] in ("failed", "finished")] == [
        "failed", "finished",
    ]  # fmt: skip
    (failed,) = (e for e in events if e["event"] == "failed")
    assert (failed["input"], failed["exit_code"]) == (str(tmp_path / "bad.mp4"), 3)
    assert "not a readable video" in failed["message"]


@pytest.mark.parametrize("flags", [("--verify",), ("--report", "--null"), ("--dry-run",)])
def test_every_failure_has_its_event(flags: tuple[str, ...], tmp_path: Path) -> None:
    assert run("convert", CLIP, tmp_path / "out", *FLAGS, "--frames", "1").returncode == 0
    done = run("convert", CLIP, tmp_path / "out", "--frames", "1-2", "--json", "--quiet", *flags)
    failed = json.loads(done.stdout.splitlines()[-1])
    assert (failed["event"], failed["exit_code"]) == ("failed", done.returncode)
    assert done.returncode > 0
