"""A run over part of a folder names the frames that it leaves with other settings."""

from __future__ import annotations

import os
import threading
from contextlib import suppress
from pathlib import Path

import pytest
from clips import moving_scene, write_ffv1

from itmo_video import RunOptions, convert, make_settings
from itmo_video.conversion import checking
from itmo_video.events import Event, Warned

OLD = make_settings("paper", lights=16, radius=64)
NEW = make_settings("paper", lights=16, radius=64, peak_nits=600.0)


@pytest.fixture
def clip(tmp_path: Path) -> Path:
    return write_ffv1(tmp_path / "clip.mkv", moving_scene(8, width=48, height=32))


def _told(clip: Path, out: Path, run: RunOptions) -> list[str]:
    """What a run says of the frames that it leaves."""
    events: list[Event] = []
    convert(clip, out, NEW, run, events.append)
    told = [event.message for event in events if isinstance(event, Warned)]
    return [text for text in told if "other settings" in text or "not of this" in text]


def test_an_update_of_part_names_the_rest(tmp_path: Path, clip: Path) -> None:
    out = tmp_path / "out"
    convert(clip, out, OLD)
    planned = checking.describe_plan(clip, out, NEW, RunOptions(frames="2-3", update=True))
    assert "notice: 6 frames (1,4-8) are of other settings or another source; the same" in planned
    (told,) = _told(clip, out, RunOptions(frames="2-3", update=True))
    assert told == (
        "6 frames (1,4-8) are of other settings or another source; the same command with "
        "--frames 1,4-8 re-renders them"
    )
    assert _told(clip, out, RunOptions(frames="1-7", overwrite=True)) == [
        "1 frame (8) is of other settings or another source; the same command with --frames 8 "
        "re-renders them"
    ]
    assert _told(clip, out, RunOptions(update=True)) == []
    assert _told(clip, out, RunOptions(frames="2", update=True)) == [], "all have them now"
    assert checking.verify(clip, out, NEW, RunOptions()) == []


def test_frames_of_other_numbers_and_other_clips_are_named(tmp_path: Path, clip: Path) -> None:
    out, other = tmp_path / "out", tmp_path / "other.mkv"
    convert(clip, out, OLD, RunOptions(frames="1-4"))
    (told,) = _told(clip, out, RunOptions(start_number=4, update=True))
    assert told.startswith("3 EXR files in the folder are not of this conversion (clip.0001.exr,")
    write_ffv1(other, moving_scene(2, width=48, height=32))
    (told,) = _told(other, out, RunOptions(overwrite=True))
    assert told.startswith("11 EXR files")
    assert "(clip.0001.exr, clip.0002.exr, clip.0003.exr, ...)" in told


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no FIFOs here")
def test_a_pipe_over_part_of_a_folder(tmp_path: Path, clip: Path) -> None:
    fifo, out = tmp_path / "clip.fifo", tmp_path / "out"
    os.mkfifo(fifo)

    def feed() -> None:
        with suppress(BrokenPipeError):  # a range ends before the stream does
            fifo.write_bytes(clip.read_bytes())

    told: list[str] = []
    for settings, run in ((OLD, RunOptions()), (NEW, RunOptions(frames="1-3", overwrite=True))):
        feeder = threading.Thread(target=feed)
        feeder.start()
        events: list[Event] = []
        convert(fifo, out, settings, run, events.append)
        feeder.join(30)
        told += [event.message for event in events if isinstance(event, Warned)]
    assert [text for text in told if text.startswith("5 frames (4-8) are of other settings")]
    assert len([text for text in told if "of other settings" in text]) == 1


def test_a_frame_that_cannot_be_read_has_no_settings(tmp_path: Path, clip: Path) -> None:
    out = tmp_path / "out"
    convert(clip, out, OLD, RunOptions(frames="1-3"))
    (out / "clip.0001.exr").write_bytes(b"")
    (out / "clip.0002.exr").write_bytes((out / "clip.0002.exr").read_bytes()[:2000])
    (told,) = _told(clip, out, RunOptions(frames="4", update=True))
    assert told.startswith("2 frames (2-3) are of other"), "a cut file still states its settings"
