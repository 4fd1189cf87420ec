"""A library leaves its process as it found it; and what it does without settings is one thing."""

from __future__ import annotations

import os
import sys
import threading
from pathlib import Path

import cv2
import pytest
from clips import moving_scene, write_ffv1

from itmo_video import convert, make_settings
from itmo_video.cli.main import main
from itmo_video.conversion.plan import RunOptions
from itmo_video.delivery.preview import PreviewOptions, preview
from itmo_video.rendering.opencv_threads import single_opencv_thread


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_ffv1(tmp_path_factory.mktemp("clip") / "clip.mkv", moving_scene(6))


@pytest.fixture(autouse=True)
def _untouched(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("SVT_LOG", raising=False)


def test_the_process_is_left_as_it_was(
    clip: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    threads_before = cv2.getNumThreads()
    cv2.setNumThreads(3)
    environment, stdout = dict(os.environ), sys.stdout
    try:
        convert(clip, tmp_path / "out")
        preview(tmp_path / "out", tmp_path / "a.mp4")
        preview(clip, tmp_path / "b.avif", options=PreviewOptions(frame=2))
        with pytest.raises(ZeroDivisionError):
            convert(clip, tmp_path / "o2", on_event=lambda event: 1 / 0)  # type: ignore[arg-type,return-value]
        assert cv2.getNumThreads() == 3, "OpenCV's threads were not given back"
    finally:
        cv2.setNumThreads(threads_before)
    assert dict(os.environ) == environment
    assert sys.stdout is stdout
    assert capfd.readouterr() == ("", ""), "an encoder wrote by itself"


def test_threads_are_given_back_by_the_last_user() -> None:
    before = cv2.getNumThreads()
    cv2.setNumThreads(4)
    leave, entered = threading.Event(), threading.Event()

    def other() -> None:
        with single_opencv_thread():
            entered.set()
            leave.wait(10)

    thread = threading.Thread(target=other)
    try:
        with single_opencv_thread():
            thread.start()
            entered.wait(10)
        assert cv2.getNumThreads() == 1, "taken from the other user"
        leave.set()
        thread.join()
        assert cv2.getNumThreads() == 4
    finally:
        leave.set()
        cv2.setNumThreads(before)


def test_hevc_tells_no_placeholder(clip: Path, tmp_path: Path) -> None:
    """x265's own SEI lists its options: `cll=42405,58025` is no light of the film's."""
    preview(clip, tmp_path / "a.mp4", options=PreviewOptions(codec="hevc"))
    data = (tmp_path / "a.mp4").read_bytes()
    assert b"cll=" not in data
    assert b"x265" not in data


def test_library_and_command_have_one_default(clip: Path, tmp_path: Path) -> None:
    made = convert(clip, tmp_path / "out")
    assert made.written == 6
    assert main(["convert", str(clip), str(tmp_path / "out"), "--quiet"]) == 0
    again = convert(clip, tmp_path / "out", make_settings(), RunOptions())
    assert (again.present, again.written) == (6, 0), "the command made its own"
