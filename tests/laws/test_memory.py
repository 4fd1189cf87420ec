"""Memory is bounded by jobs and span, whatever the clip's length."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
import weakref
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from clips import moving_scene, still_encoding, write_ffv1

from itmo_video import make_settings
from itmo_video.look import make_look
from itmo_video.model import Frame
from itmo_video.rendering.spans import frames_in_flight, render_frames
from itmo_video.source.clip import Clip

CODE = """
import resource, sys
from itmo_video import RunOptions, convert, make_settings
convert(sys.argv[1], 'out', make_settings(), RunOptions(jobs=2, null=True))
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


def peak_kb(clip: Path) -> int:
    run = subprocess.run(
        [sys.executable, "-c", CODE, str(clip)],
        capture_output=True, text=True, check=True, timeout=240,
    )  # fmt: skip
    return int(run.stdout)


def test_memory_does_not_grow_with_the_clip(tmp_path: Path) -> None:
    # A frame kept, the smallest leak, would be 20 MB after 960 of them.
    frames = list(moving_scene(60, width=192, height=108))
    short = write_ffv1(tmp_path / "short.mkv", frames * 4)  # queues and heaps are full by then
    long = write_ffv1(tmp_path / "long.mkv", frames * 20)
    a, b = peak_kb(short), peak_kb(long)
    assert b < 1.05 * a, f"240 frames took {a} kB, 1200 frames {b} kB"


class CountedClip(Clip):
    """Frames from memory, flashes among them, that tell how many of them live at a time."""

    def __init__(self, count: int, flashes: frozenset[int]) -> None:
        self._pictures = list(moving_scene(count))
        self._flashes = flashes
        self._lock = threading.Lock()
        self._alive = 0
        self.most = 0

    def _count(self, by: int) -> None:
        with self._lock:
            self._alive += by
            self.most = max(self.most, self._alive)

    def frames(self, start: int = 0) -> Iterator[Frame]:
        encoding = still_encoding("grey")
        for n, picture in enumerate(self._pictures):
            if n >= start:
                codes = (
                    np.full_like(picture[..., 0], 250) if n in self._flashes else picture[..., 0]
                )
                frame = Frame(n, Fraction(n, 24), (codes,), encoding)
                self._count(1)
                weakref.finalize(frame, self._count, -1)
                yield frame
                del frame


@pytest.mark.parametrize("preset", ["default", "paper"])
@pytest.mark.parametrize("jobs", [1, 3])
def test_frames_held_are_no_more_than_stated(preset: str, jobs: int) -> None:
    """Also where flashes on the key grid make spans longer than the interval."""
    look = make_look(make_settings(preset, lights=16))
    clip = CountedClip(90, frozenset(n + k for n in range(20, 70, 10) for k in (0, 1, 2)))
    stated = frames_in_flight(look, jobs)
    # Workers that are slower than the decoder, so that all that may wait does.
    render_frames(clip, range(90), look, jobs, lambda frame, rendered: time.sleep(0.02))
    assert 0.6 * stated < clip.most <= stated
