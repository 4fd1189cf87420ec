"""A library leaves its process as it found it; and what it does without settings is one thing."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import av
import cv2
import pytest
from clips import moving_scene, write_ffv1

from itmo_video import convert, make_settings
from itmo_video.cli.main import main
from itmo_video.conversion.run_options import RunOptions
from itmo_video.delivery import svt_av1
from itmo_video.delivery.preview import preview
from itmo_video.delivery.preview_options import PreviewOptions
from itmo_video.delivery.svt_av1 import svt_as_guest
from itmo_video.rendering.opencv_threads import single_opencv_thread


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_ffv1(tmp_path_factory.mktemp("clip") / "clip.mkv", moving_scene(6))


@pytest.fixture(autouse=True)
def _untouched(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("SVT_LOG", raising=False)


PROGRAM = """
import os, sys
import cv2
from itmo_video import convert
from itmo_video.delivery.preview import preview
from itmo_video.delivery.preview_options import PreviewOptions

clip, folder = sys.argv[1:]
cv2.setNumThreads(3)
environment, stdout = dict(os.environ), sys.stdout
convert(clip, folder + "/out")
preview(folder + "/out", folder + "/a.mp4")
preview(clip, folder + "/b.avif", options=PreviewOptions(frame=2))
try:
    convert(clip, folder + "/o2", on_event=lambda event: 1 / 0)
except ZeroDivisionError:
    pass
else:
    raise AssertionError("what a listener raises is lost")
assert cv2.getNumThreads() == 3, "OpenCV's threads were not given back"
assert dict(os.environ) == environment, "the environment was changed"
assert sys.stdout is stdout
if sys.platform == "linux":
    classes = {os.sched_getscheduler(int(thread)) for thread in os.listdir("/proc/self/task")}
    assert classes == {os.SCHED_OTHER}, "an encoder made real-time threads"
"""


def test_the_process_is_left_as_it_was(clip: Path, tmp_path: Path) -> None:
    """In a process of its own: an encoder opened by another test may have said its lines before."""
    ended = subprocess.run(
        [sys.executable, "-W", "error", "-c", PROGRAM, str(clip), str(tmp_path)],
        capture_output=True, text=True, timeout=200,
    )  # fmt: skip
    assert (ended.returncode, ended.stderr) == (0, "")
    assert ended.stdout == "", "an encoder wrote by itself"


@pytest.mark.skipif(sys.platform != "linux", reason="scheduling classes of Linux")
def test_the_encoder_of_films_is_opened_by_an_ordinary_thread(tmp_path: Path) -> None:
    """Where it may (root), SVT-AV1 makes itself and its caller real-time threads."""
    opened = av.open(str(tmp_path / "a.mkv"), "w")
    stream: Any = opened.add_stream("libsvtav1", rate=1)
    stream.width, stream.height, stream.pix_fmt = 64, 64, "yuv420p10le"
    before = svt_av1._effective()
    with svt_as_guest():
        stream.codec_context.open()
    assert svt_av1._effective() == before, "a right was not given back"
    classes = {os.sched_getscheduler(int(thread)) for thread in os.listdir("/proc/self/task")}
    opened.close()
    assert classes == {os.SCHED_OTHER}


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
