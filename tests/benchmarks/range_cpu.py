"""CPU time of a clip in ranges against the whole: python range_cpu.py CLIP FRAMES LENGTH [--plain].

Prints seconds of user and system time, children included, and whether all bytes agree. Needs room
for two conversions.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
from pathlib import Path

from kernels_run import require_kernels

REPOSITORY = Path(__file__).resolve().parents[2]


def cpu_s(clip: Path, out: Path, *flags: str) -> float:
    """Convert in a process of its own and return its CPU time in seconds."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sys.executable, "-m", "itmo_video", "convert", str(clip), str(out), "--quiet"]
    subprocess.run([*command, *flags], cwd=REPOSITORY, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main(clip: Path, frames: int, length: int) -> None:
    """Measure both ways and compare the folders."""
    with tempfile.TemporaryDirectory(prefix="itmo-range-") as scratch:
        whole, ranges = Path(scratch) / "whole", Path(scratch) / "ranges"
        once = cpu_s(clip, whole)
        print(f"whole: {once:.1f} s", flush=True)
        total = 0.0
        for first in range(1, frames + 1, length):
            last = min(frames, first + length - 1)
            took = cpu_s(clip, ranges, "--frames", f"{first}-{last}")
            print(f"{first}-{last}: {took:.1f} s", flush=True)
            total += took
        same = all(p.read_bytes() == (ranges / p.name).read_bytes() for p in whole.iterdir())
        print(f"ranges: {total:.1f} s, {total / once:.3f} times the whole; same bytes: {same}")


if __name__ == "__main__":
    require_kernels("--plain" in sys.argv)
    main(Path(sys.argv[1]).resolve(), int(sys.argv[2]), int(sys.argv[3]))
