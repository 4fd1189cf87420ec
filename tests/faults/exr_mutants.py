"""Mutants of EXR frames of every compression through `read_exr`, in one process.

    python tests/faults/exr_mutants.py [--count 910] [--seed 0]

`--count` is of each of the 11 compressions; mutant `n` is that of compression, seed and n alone.
Wrong is any error but InputError, one that takes over five seconds, and 2 GB more memory.
"""

from __future__ import annotations

import argparse
import random
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from clips import moving_scene, write_ffv1
from peak_memory import forget_peak, peak_kb

from itmo_video import convert, make_settings
from itmo_video.errors import InputError
from itmo_video.output.exr import read_exr
from itmo_video.output.exr_chunks import parse_header

MEMORY_KB, SECONDS = 2 << 20, 5
COMPRESSIONS = (
    "none", "rle", "zips", "zip", "piz", "pxr24", "b44", "dwaa", "dwab", "htj2k", "zstd",
)  # fmt: skip
_EXTREMES = (b"\xff" * 4, b"\0" * 4, b"\xff\xff\xff\x7f", b"\0\0\0\x80", b"\0\0\x80\x7f")


def mutant(data: bytes, rng: random.Random) -> bytes:
    """Bytes changed, in the header above all; numbers made extreme; cut short."""
    out = bytearray(data)
    _, end = parse_header(data)
    for _ in range(rng.choice((1, 2, 8))):
        at = rng.randrange(end if rng.random() < 0.7 else len(out))
        if rng.random() < 0.3:
            out[at : at + 4] = rng.choice(_EXTREMES)
        else:
            out[at] = rng.randrange(256)
    if rng.random() < 0.2:
        del out[rng.randrange(len(out)) :]
    return bytes(out)


def failures(compression: str, count: int, seed: int) -> Iterator[tuple[int, str]]:
    """(number, what is wrong) of the mutants that are neither read nor refused as they should be.

    A mutant that is read may have other pixels: not every compression has a check sum.
    """
    codes: Counter[str] = Counter()
    slowest, already_kb = 0.0, forget_peak()
    with tempfile.TemporaryDirectory() as name:
        clip = write_ffv1(Path(name) / "c.mkv", moving_scene(1, width=40, height=24))
        convert(clip, Path(name) / "o", make_settings("paper", lights=16, compression=compression))
        sound, path = (Path(name) / "o/c.0001.exr").read_bytes(), Path(name) / "m.exr"
        for number in range(count):
            path.write_bytes(mutant(sound, random.Random(f"{compression} {seed} {number}")))
            began = time.process_time()
            try:
                read_exr(path)
                codes["read"] += 1
            except InputError:
                codes["refused"] += 1
            except Exception:
                yield number, traceback.format_exc()
            taken = time.process_time() - began
            slowest = max(slowest, taken)
            if taken > SECONDS:
                yield number, f"it takes {taken:.1f} s"
            if peak_kb() - already_kb > MEMORY_KB:
                yield number, "it takes 2 GB more"
                break
    peak = peak_kb() >> 10
    print(compression, dict(codes), f"slowest {slowest:.2f} s, {peak} MB", file=sys.stderr)


def main() -> int:
    """Run all and tell."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=910)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    bad = 0
    for compression in COMPRESSIONS:
        for number, what in failures(compression, args.count, args.seed):
            bad += 1
            print(f"{compression} {number}: {what[-1500:]}", flush=True)
    print(f"{bad} failures")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
