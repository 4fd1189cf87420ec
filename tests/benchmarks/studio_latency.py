"""How soon a change shows in the studio at 1080p, and whether memory stays bounded.

python tests/benchmarks/studio_latency.py [--changes 500]
Prints, for the half-size picture that comes first and for the whole one, median and 95th percentile
of the time from a changed setting to the bytes for the page, in seconds of wall clock and of CPU
(on a busy machine only the latter tells), and the process's memory before and after all changes.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from clips import moving_scene, write_ffv1

from itmo_video import make_settings
from itmo_video.look import make_look
from itmo_video.source.files import MAX_PIXELS
from itmo_video.source.opening import input_options
from itmo_video.studio.session import Session

FRAME = 20
CURVE = ("peak_nits", 400.0, 4000.0)
MAP = ("radius", 8.0, 40.0)


def resident_mb() -> float:
    """Memory of this process as Linux counts it."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmRSS"):
            return int(line.split()[1]) / 1024
    return float("nan")


def timed(session: Session, name: str, low: float, high: float, count: int) -> None:
    """Change one setting `count` times over and print how long pictures took."""
    walls: dict[int, list[float]] = {2: [], 1: []}
    processors: dict[int, list[float]] = {2: [], 1: []}
    for value in np.linspace(low, high, count):
        look = make_look(make_settings("default", **{name: float(value)}))
        wall, processor = time.perf_counter(), time.process_time()
        for scale in (2, 1):
            session.picture(FRAME, look, scale=scale).planes.tobytes()
            walls[scale].append(time.perf_counter() - wall)
            processors[scale].append(time.process_time() - processor)
    for scale, words in ((2, "half size"), (1, "full size")):
        (m, p), (cm, cp) = (np.percentile(times[scale], (50, 95)) for times in (walls, processors))
        print(f"{name:10} {words}: wall {m:.3f} s, 95 % {p:.3f} s; CPU {cm:.3f} s, 95 % {cp:.3f} s")


def main() -> None:
    """Make the clip, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--changes", type=int, default=500, help="for memory (500)")
    count = parser.parse_args().changes
    with tempfile.TemporaryDirectory() as folder:
        frames = (
            cv2.resize(frame, (1920, 1080), interpolation=cv2.INTER_CUBIC)
            for frame in moving_scene(40, width=480, height=270)
        )
        clip = write_ffv1(Path(folder) / "hd.mkv", frames, stored="yuv420p")
        with Session(clip, input_options(make_settings(), MAX_PIXELS)) as session:
            began = time.perf_counter()
            session.picture(FRAME, make_look(make_settings()))
            print(f"first picture: {time.perf_counter() - began:.2f} s")
            for setting in (CURVE, MAP):
                timed(session, *setting, 50)
            before = resident_mb()
            for step in range(count):
                look = make_look(make_settings("default", radius=5 + step / 20, lights=256))
                session.picture(step % 40, look, scale=2)
            print(f"memory: {before:.0f} MB, after {count} changes {resident_mb():.0f} MB")


if __name__ == "__main__":
    main()
