"""The whole command against `ffmpeg -c:v exr`, which expands nothing; prints a table in Markdown.

    python tests/benchmarks/against_ffmpeg.py [--rounds 5] [--frames 144] [--only NAME,...]
        [--work FOLDER]

Makes its own clips (moving, noisy, with lamps) at 1080p and 2160p, 8 and 10 bit, in FOLDER, where
they stay. All commands of a round run one after the other on the same clip: its ratios compare like
with like. A round takes about two and a half minutes on two cores of 2025.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import platform
import re
import shlex
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from fractions import Fraction
from importlib.metadata import version
from pathlib import Path

import av
import cv2
import numpy as np
from kernels_run import add_plain, require_kernels

SPAWN = multiprocessing.get_context("spawn")
REPOSITORY = Path(__file__).resolve().parents[2]
# The least speed that is wanted, as a multiple of that of the row it is compared with.
GOALS = {"ours none": 0.85, "ours zips": 3.5, "ours zip": 3.5, "ours null": 1.7}
GOALS |= {"ours null 2160p": 1 / 4.2}


@dataclass(frozen=True)
class Cost:
    """What one run took: wall and CPU seconds, peak memory in MB, MB written."""

    wall_s: float
    cpu_s: float
    peak_mb: float
    written_mb: float


def make_clip(path: Path, width: int, height: int, frames: int, pixel_format: str) -> Path:
    """A pan over a textured ground with lamps and grain, H.264 BT.709 limited."""
    if path.exists():
        return path
    rng = np.random.default_rng(0)
    wide = cv2.GaussianBlur(rng.random((height, width + 4 * frames), np.float32), (0, 0), 12)
    wide = (wide - wide.min()) / (wide.max() - wide.min()) * 0.6
    for x, y, r in rng.integers((0, 0, 4), (wide.shape[1], height, height // 20), (60, 3)):
        cv2.circle(wide, (int(x), int(y)), int(r), 1.0, -1, cv2.LINE_AA)
    grain = [rng.normal(0, 0.012, (height, width)).astype(np.float32) for _ in range(5)]
    part = path.with_name(f"part-{path.name}")  # renamed when whole
    with av.open(str(part), "w") as box:
        stream = box.add_stream(
            "libx264", rate=Fraction(24), options={"crf": "20", "preset": "veryfast"}
        )
        stream.width, stream.height, stream.pix_fmt = width, height, pixel_format
        context = stream.codec_context
        context.color_primaries = context.color_trc = context.colorspace = 1
        context.color_range = 1
        for n in range(frames):
            view = np.clip(wide[:, 4 * n : 4 * n + width] + grain[n % 5], 0, 1) * 65535
            rgb = np.dstack([view, view * 0.94, view * 0.85]).astype(np.uint16)
            frame = av.VideoFrame.from_ndarray(rgb, "rgb48le").reformat(format=pixel_format)
            frame.pts = n
            box.mux(stream.encode(frame))
        box.mux(stream.encode())
    return part.rename(path)


def run(command: list[str], out: Path, cores: int | None = None) -> Cost:
    """Run a command with an empty output folder, pinned to `cores` cores if given."""
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir()
    pin = (lambda: os.sched_setaffinity(0, range(cores))) if cores else None
    # Bytecode is kept from run to run, as pip makes it once at installation.
    env = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    env["PYTHONPYCACHEPREFIX"] = str(out.with_name("bytecode"))
    began = time.monotonic()
    child = subprocess.Popen(
        command,
        cwd=REPOSITORY,
        env=env,
        preexec_fn=pin,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    _, status, usage = os.wait4(child.pid, 0)
    wall = time.monotonic() - began
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode:
        raise SystemExit(f"exit code {child.returncode}: {' '.join(command)}")
    written = sum(p.stat().st_size for p in out.rglob("*") if p.is_file()) / 1e6
    shutil.rmtree(out)
    return Cost(wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1e3, written)


TOOL = [sys.executable, "-m", "itmo_video"]


def ours(clip: Path, out: Path, *flags: str) -> list[str]:
    """Our command."""
    return [*TOOL, "convert", str(clip), str(out / "o"), "--quiet", *flags]


def ffmpeg(clip: Path, out: Path, compression: str) -> list[str]:
    """The alternative's."""
    options = ["-c:v", "exr", "-format", "half", "-compression", compression]
    return ["ffmpeg", "-v", "error", "-i", str(clip), *options, str(out / "f%05d.exr")]


def machine() -> str:
    """What the figures were measured on and with."""
    model = platform.machine()
    if (cpus := Path("/proc/cpuinfo")).exists() and (
        found := re.search(r"model name\s*: (.*)", cpus.read_text())
    ):
        model = found[1]
    told = subprocess.run(["ffmpeg", "-version"], capture_output=True, text=True, check=True)
    parts = ("av", "numpy", "OpenEXR", "opencv-contrib-python-headless", "deflate")
    return (
        f"{len(os.sched_getaffinity(0))} cores of {model}; Python {platform.python_version()}, "
        + ", ".join(f"{part} {version(part)}" for part in parts)
        + f"; FFmpeg {told.stdout.split()[2]}"
    )


def main() -> None:
    """Run the rounds and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--frames", type=int, default=144)
    parser.add_argument("--only", default="")
    parser.add_argument("--work", type=Path)
    add_plain(parser)
    args = parser.parse_args()
    kernels = require_kernels(args.plain, TOOL)
    work = args.work.resolve() if args.work else Path(tempfile.mkdtemp(prefix="itmo-bench-"))
    work.mkdir(exist_ok=True)
    n, out = args.frames, work / "out"
    hd, hd10 = work / "hd8.mp4", work / "hd10.mp4"
    uhd, uhd10 = work / "uhd8.mp4", work / "uhd10.mp4"

    # name: (command, frames, pinned cores, the row that it is compared with)
    rows: dict[str, tuple[list[str], int, int | None, str | None]] = {
        "ffmpeg none": (ffmpeg(hd, out, "none"), n, None, None),
        "ours none": (ours(hd, out, "--compression", "none"), n, None, "ffmpeg none"),
        "ffmpeg zip1": (ffmpeg(hd, out, "zip1"), n, None, None),
        "ours zips": (ours(hd, out, "--compression", "zips"), n, None, "ffmpeg zip1"),
        "ffmpeg zip16": (ffmpeg(hd, out, "zip16"), n, None, None),
        "ours zip": (ours(hd, out, "--compression", "zip"), n, None, "ffmpeg zip16"),
        "ours zip, paper": (ours(hd, out, "--preset", "paper"), n, None, "ffmpeg zip16"),
        "ours null, one core": (ours(hd, out, "--null"), n, 1, None),
        "ours null": (ours(hd, out, "--null"), n, None, "ours null, one core"),
        "ours null 10 bit": (ours(hd10, out, "--null"), n, None, "ours null"),
        "ours null 2160p": (ours(uhd, out, "--null"), n // 2, None, "ours null"),
        "ours null 2160p 10 bit": (ours(uhd10, out, "--null"), n // 2, None, "ours null"),
        "ours --help": ([*TOOL, "--help"], 1, None, None),
        "ours info": ([*TOOL, "info", str(hd)], 1, None, None),
    }
    if args.only:
        rows = {name: row for name, row in rows.items() if name in args.only.split(",")}
    for path, width, height, count, pixel_format in (
        (hd, 1920, 1080, n, "yuv420p"),
        (hd10, 1920, 1080, n, "yuv420p10le"),
        (uhd, 3840, 2160, n // 2, "yuv420p"),
        (uhd10, 3840, 2160, n // 2, "yuv420p10le"),
    ):
        if not any(str(path) in row[0] for row in rows.values()):
            continue
        # In a process of its own: a child's peak memory begins at its parent's.
        making = SPAWN.Process(target=make_clip, args=(path, width, height, count, pixel_format))
        making.start()
        making.join()
    costs: dict[str, list[Cost]] = {name: [] for name in rows}
    for _ in range(args.rounds):
        for name, (command, _frames, cores, _against) in rows.items():
            costs[name].append(run(command, out, cores))
    asked = shlex.join(["python", "tests/benchmarks/against_ffmpeg.py", *sys.argv[1:]])
    print(f"`{asked}`")
    print(f"({args.rounds} rounds of {n} frames, half as many of 2160p; medians)\n")
    print(f"{machine()}; {kernels}\n")
    print("| run | fps | CPU ms/frame | peak MB | MB/frame | speed | goal |")
    print("| --- | ---: | ---: | ---: | ---: | --- | --- |")
    for name, (_command, frames, _cores, against) in rows.items():
        mine = costs[name]
        wall = statistics.median(c.wall_s for c in mine)
        ratio = goal = ""
        if against in costs:
            ratios = [
                (b.wall_s / rows[against][1]) / (c.wall_s / frames)
                for b, c in zip(costs[against], mine, strict=True)
            ]
            ratio = f"{statistics.median(ratios):.2f}x {against}"
            if name in GOALS:
                met = statistics.median(ratios) >= GOALS[name]
                goal = f"{GOALS[name]:.2f}x: {'met' if met else 'not met'}"
        print(
            f"| {name} | {frames / wall:.1f} "
            f"| {statistics.median(c.cpu_s for c in mine) / frames * 1e3:.0f} "
            f"| {max(c.peak_mb for c in mine):.0f} "
            f"| {statistics.median(c.written_mb for c in mine) / frames:.1f} | {ratio} | {goal} |"
        )


if __name__ == "__main__":
    main()
