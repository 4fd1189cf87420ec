"""CPU time a frame of everything temporal, and its share of the whole conversion.

    python tests/benchmarks/temporal_cost.py [CLIP] [--frames N] [--rounds N]

Without a clip it makes one of 1080p, N frames long. A clip is converted whole, as a range would
look ahead and pay for frames that are not its own. Each part's threads are timed where the
conversion itself calls it; the smallest of the rounds counts, as others on the machine only add.
"""

from __future__ import annotations

import argparse
import tempfile
import threading
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

from against_ffmpeg import make_clip
from kernels_run import add_plain, require_kernels

from itmo_video import RunOptions, convert, make_settings
from itmo_video.motion import flow, keyframes
from itmo_video.rendering import guidance, spans

PARTS: dict[str, tuple[tuple[Any, str], ...]] = {
    "analysis picture": ((spans, "analyse_frame"),),
    "key maps": ((spans, "make_key_map"),),
    "smoothing over keys, with flow from key to key": (
        (keyframes, "smooth_map"),
        (flow, "flow_px"),  # those within tracking count there
    ),
    "tracking, with flow to both keys": ((flow, "track_map"),),
    "map brought up, noise guard": ((guidance.Guidance, "__init__"), (guidance.Guidance, "rows")),
}


class Meter:
    """CPU seconds by part; a part within another counts for the outer one."""

    def __init__(self) -> None:
        self.spent_s: defaultdict[str, float] = defaultdict(float)
        self._lock = threading.Lock()
        self._local = threading.local()

    def timed(self, part: str, call: Callable[..., Any]) -> Callable[..., Any]:
        """`call`, its thread's CPU time counted."""

        def measured(*args: Any, **more: Any) -> Any:
            if getattr(self._local, "within", False):
                return call(*args, **more)
            self._local.within = True
            start = time.thread_time()
            try:
                return call(*args, **more)
            finally:
                with self._lock:
                    self.spent_s[part] += time.thread_time() - start
                self._local.within = False

        return measured


def measure(clip: Path, out: Path) -> dict[str, float]:
    """Milliseconds of CPU a frame of each part and of the whole, by one conversion."""
    meter = Meter()
    saved = [(place, name, getattr(place, name)) for p in PARTS.values() for place, name in p]
    try:
        for part, places in PARTS.items():
            for place, name in places:
                setattr(place, name, meter.timed(part, getattr(place, name)))
        start = time.process_time()
        frames = convert(clip, out, make_settings("default"), RunOptions()).written
        whole_s = time.process_time() - start
    finally:
        for place, name, original in saved:
            setattr(place, name, original)
    return {name: 1e3 * s / frames for name, s in (*meter.spent_s.items(), ("whole", whole_s))}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("clip", type=Path, nargs="?")
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--rounds", type=int, default=3)
    add_plain(parser)
    args = parser.parse_args()
    require_kernels(args.plain)
    with tempfile.TemporaryDirectory(prefix="itmo-temporal-") as scratch:
        clip = args.clip or make_clip(
            Path(scratch) / "made.mp4", 1920, 1080, args.frames, "yuv420p"
        )
        rounds = [measure(clip, Path(scratch) / f"out{n}") for n in range(args.rounds)]
    best = min(rounds, key=lambda found: found["whole"])
    temporal = sum(ms for name, ms in best.items() if name != "whole")
    for name, ms in (*best.items(), ("everything temporal", temporal)):
        print(f"| {name} | {ms:.1f} ms | {100 * ms / best['whole']:.0f} % |")


if __name__ == "__main__":
    main()
