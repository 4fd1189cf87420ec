"""All that is asked of speed and memory, in one run: what was found, the goal, whether it is met.

    python tests/benchmarks/speed_goals.py [--rounds 5] [--work FOLDER]

Medians of rounds, in each of which all commands run one after the other on clips of its own making
(they stay in FOLDER), so that ratios compare like with like. Some seven minutes on two idle cores.
"""

from __future__ import annotations

import argparse
import multiprocessing
import statistics
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from against_ffmpeg import SPAWN, TOOL, Cost, ffmpeg, machine, make_clip, ours, run
from kernels_run import add_plain, require_kernels

FRAMES, FEW = 144, 48  # of 1080p; of what ffmpeg packs slowly
MEMORY_MB = 64  # copied to and fro beside a run
CLIPS = {"hd": (1920, 1080, FRAMES, "yuv420p"), "few": (1920, 1080, FEW, "yuv420p"),
         "uhd": (3840, 2160, FRAMES // 2, "yuv420p"),
         "uhd10": (3840, 2160, FRAMES // 2, "yuv420p10le")}  # fmt: skip
DECODING = """
import sys, time
from itmo_video import open_clip
with open_clip(sys.argv[1]) as clip:
    began, count = time.process_time(), sum(1 for _ in clip.frames())
    print(1e3 * (time.process_time() - began) / count)
"""
NETWORK = """
import time
import cv2, numpy as np
from itmo_video.operators.auto_levels import expected_levels, level_shares
cv2.setNumThreads(1)
picture = np.random.default_rng(0).random((288, 512, 3), np.float32)
took = []
for _ in range(9):
    began = time.thread_time()
    expected_levels(level_shares(picture), picture.shape[:2], 5.0)
    took.append(time.thread_time() - began)
print(1e3 * min(took) / 5)  # keys stand five frames apart
"""
Costs = defaultdict[str, list[Cost]]


def _copy_for_ever() -> None:
    import numpy as np

    source = np.ones(MEMORY_MB << 20, np.uint8)
    target = np.empty_like(source)
    while True:
        np.copyto(target, source)


@contextmanager
def busy_neighbour() -> Iterator[None]:
    """A process beside this one that copies memory all the time."""
    process = SPAWN.Process(target=_copy_for_ever, daemon=True)
    process.start()
    time.sleep(1)
    try:
        yield
    finally:
        process.terminate()
        process.join()


def told(script: str, *arguments: str) -> float:
    """The number that a script prints, in a process of its own."""
    command = [sys.executable, "-c", script, *arguments]
    return float(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def measure(work: Path, rounds: int) -> tuple[Costs, list[float], list[float]]:
    """The costs of all runs by name, and the CPU milliseconds of decoding and of the network."""
    out = work / "out"
    clips = {name: work / f"{name}.mp4" for name in CLIPS}
    for name, about in CLIPS.items():
        making = SPAWN.Process(target=make_clip, args=(clips[name], *about))
        making.start()
        making.join()
    loops = work / "long.mp4"  # 1,200 frames
    if not loops.exists():
        looped = ["ffmpeg", "-v", "error", "-stream_loop", "-1", "-i", str(clips["hd"])]
        subprocess.run([*looped, "-frames:v", "1200", "-c", "copy", str(loops)], check=True)
    hd, few = clips["hd"], clips["few"]
    null = "--null"
    commands = {
        "null": ours(hd, out, null),
        "null few": ours(few, out, null),
        "null 2160p": ours(clips["uhd"], out, null),
        "null 2160p 10 bit": ours(clips["uhd10"], out, null),
        "ffmpeg none": ffmpeg(hd, out, "none"),
        "none": ours(hd, out, "--compression", "none"),
        "ffmpeg zip16": ffmpeg(few, out, "zip16"),
        "zip": ours(hd, out, "--compression", "zip"),
        "ffmpeg zip1": ffmpeg(few, out, "zip1"),
        "zips": ours(hd, out, "--compression", "zips"),
        "dask": ours(hd, out, null, "--scheduler", "local", "--jobs", "2"),
        "dwaa": ours(few, out, "--compression", "dwaa"),
        "htj2k": ours(few, out, "--compression", "htj2k"),
        "one frame": ours(hd, out, null, "--frames", "1"),
        "--help": [*TOOL, "--help"],
        "import": [sys.executable, "-c", "import itmo_video"],
    }
    costs: Costs = defaultdict(list)
    decoding, network = [], []
    for _ in range(rounds):
        for name, command in commands.items():
            costs[name].append(run(command, out))
        with busy_neighbour():
            for name in ("ffmpeg none", "none"):
                costs[f"{name} beside"].append(run(commands[name], out))
        decoding.append(told(DECODING, str(hd)))
        network.append(told(NETWORK))
    costs["null 60"].append(run(ours(hd, out, null, "--frames", "1-60"), out))
    costs["null 1200"].append(run(ours(loops, out, null), out))
    return costs, decoding, network


def rows_of(
    costs: Costs, decoding: list[float], network: list[float]
) -> Iterator[tuple[str, str, str, bool | None]]:
    """Each goal's row: what, found, goal, whether it is met."""

    def wall(name: str) -> float:
        return statistics.median(cost.wall_s for cost in costs[name])

    def cpu(name: str) -> float:
        return statistics.median(cost.cpu_s for cost in costs[name])

    def peak(name: str) -> float:
        return max(cost.peak_mb for cost in costs[name])

    def by_round(name: str, other: str, frames: int, of_other: int) -> float:
        """How many times as fast as the other, by the median of rounds."""
        pairs = zip(costs[name], costs[other], strict=True)
        return statistics.median((b.wall_s / of_other) / (a.wall_s / frames) for a, b in pairs)

    hd, uhd = FRAMES / wall("null"), FRAMES / 2 / wall("null 2160p")
    yield "1080p to --null", f"{hd:.1f} fps", "60 fps", hd >= 60
    yield "2160p to --null", f"{uhd:.1f} fps", "24 fps", uhd >= 24
    share = by_round("null 2160p", "null", FRAMES // 2, FRAMES)
    yield "2160p against 1080p", f"{share:.2f}x", "0.4x", share >= 0.4
    for ours_, other, frames, goal in (
        ("none", "ffmpeg none", FRAMES, 1.0),
        ("zip", "ffmpeg zip16", FEW, 8.0),
        ("zips", "ffmpeg zip1", FEW, 5.0),
    ):
        found = by_round(ours_, other, FRAMES, frames)
        yield f"{ours_} against {other}", f"{found:.2f}x", f"{goal:.1f}x", found >= goal
    share = by_round("dask", "null", FRAMES, FRAMES)
    yield "two Dask workers against two threads", f"{share:.2f}x", "0.95x", share >= 0.95
    for compression in ("dwaa", "htj2k"):
        took = f"{FEW / wall(compression):.1f} fps, {1e3 * cpu(compression) / FEW:.0f} ms CPU"
        yield f"{compression} (by OpenEXR's own writer)", took, "", None
    # By the difference of two lengths, so that starting and ending do not count.
    own = 1e3 * (cpu("null") - cpu("null few")) / (FRAMES - FEW) - statistics.median(decoding)
    net = statistics.median(network)
    yield "the operator's own CPU a frame", f"{own - net:.1f} ms", "16 ms", own - net <= 16
    yield "the same, network included", f"{own:.1f} ms", "22 ms", own <= 22
    yield "decoding's CPU a frame", f"{statistics.median(decoding):.1f} ms", "", None
    falls = {name: 1 - wall(name) / wall(f"{name} beside") for name in ("none", "ffmpeg none")}
    met = falls["none"] <= falls["ffmpeg none"] + 0.1
    most = f"ffmpeg's {falls['ffmpeg none']:.0%}, plus 10 %"
    yield "speed lost beside a process that copies memory", f"{falls['none']:.0%}", most, met
    yield "peak memory, 1080p", f"{peak('null'):.0f} MB", "400 MB", peak("null") <= 400
    most_uhd = peak("null 2160p 10 bit")
    yield "peak memory, 2160p 10 bit", f"{most_uhd:.0f} MB", "1000 MB", most_uhd <= 1000
    grows = peak("null 1200") / peak("null 60") - 1
    yield "memory of 1,200 frames against 60", f"{grows:+.1%}", "5 %", grows <= 0.05
    for name in ("one frame", "--help", "import"):
        yield f"{name}", f"{wall(name):.2f} s, {cpu(name):.2f} s CPU", "", None


def main() -> None:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--work", type=Path)
    add_plain(parser)
    args = parser.parse_args()
    kernels = require_kernels(args.plain, TOOL)
    work = (args.work or Path(tempfile.mkdtemp(prefix="itmo-goals-"))).resolve()
    work.mkdir(exist_ok=True)
    began = time.monotonic()
    found = measure(work, args.rounds)
    print(f"{args.rounds} rounds, medians, in {time.monotonic() - began:.0f} s")
    print(f"{machine()}; {kernels}\n\n| what | found | goal | |\n| --- | ---: | ---: | --- |")
    for what, value, goal, met in rows_of(*found):
        print(
            f"| {what} | {value} | {goal} | {'' if met is None else 'met' if met else 'not met'} |"
        )


if __name__ == "__main__":
    multiprocessing.freeze_support()
    main()
