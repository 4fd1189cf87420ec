"""Damaged clips decoded whole, on one core and on two, and from places within: the same frames?

    python tests/faults/damaged_decodes.py [--trials 20] [--seed 0] [--size 96x64] [CODEC...]

Each trial is a clip with one to three places overwritten, decoded four times: whole with all cores,
whole with one, and from two frames on. New memory holds another byte each time (glibc), so that a
decoder that shows what was never written is caught. A process of its own for each codec, with 60 s
for a trial.
"""

from __future__ import annotations

import argparse
import ctypes
import multiprocessing
import os
import random
import sys
import tempfile
import zlib
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parent))

import av
import numpy as np
from codec_clips import CODECS, make_clip

from itmo_video.errors import ItmoError
from itmo_video.source.opening import open_clip
from itmo_video.source.tags import InputOptions

SECONDS = 60
_M_PERTURB = -6  # of glibc's mallopt: the byte whose complement new memory is filled with


def damaged(data: bytes, rng: random.Random) -> bytes:
    """One to three places behind the first 3 % overwritten: a bit, a byte, zeros, or noise."""
    out, size = bytearray(data), len(data)
    for _ in range(rng.choice((1, 1, 2, 3))):
        at, kind = rng.randrange(int(size * 0.03), size), rng.randrange(4)
        length = min(rng.choice((1, 4, 16, 60, 200)), size - at)
        if kind == 0:
            out[at] ^= 1 << rng.randrange(8)
        elif kind == 1:
            out[at] ^= 255
        else:
            out[at : at + length] = bytes(length) if kind == 2 else rng.randbytes(length)
    return bytes(out)


def frames(path: Path, start: int = 0) -> dict[int, int]:
    """A check sum of each frame's planes by index; -1 holds how it ended, if not well."""
    found: dict[int, int] = {}
    try:
        # As in a log file's words, else what is refused for being odd would be no trial.
        with open_clip(path, InputOptions(force_sdr=True)) as clip:
            for frame in clip.frames(start):
                check = zlib.crc32(str(frame.time_s).encode())
                for plane in frame.planes:
                    check = zlib.crc32(np.ascontiguousarray(plane).data, check)
                found[frame.index] = check
    except ItmoError as error:
        found[-1] = error.exit_code
    return found


def fill_new_memory(byte: int) -> None:
    """Let memory that was never written hold this byte (glibc); 255 leaves it as it is again."""
    if mallopt := getattr(ctypes.CDLL(None), "mallopt", None):
        mallopt(_M_PERTURB, byte ^ 255)


def trial(path: Path, rng: random.Random) -> list[str]:
    """What differs between four ways to decode a clip."""
    cores = os.sched_getaffinity(0)
    fill_new_memory(0)
    whole = frames(path)
    os.sched_setaffinity(0, {min(cores)})
    fill_new_memory(0x55)
    wrong = ["one core"] if frames(path) != whole else []
    os.sched_setaffinity(0, cores)
    last = max(whole, default=0)
    for byte in (0xAA, 0x7F):
        fill_new_memory(byte)
        start = rng.randrange(max(1, last + 1))
        part = {n: check for n, check in whole.items() if n >= start or n == -1}
        found = frames(path, start)
        if -1 in whole:  # it breaks off where its size changes; who begins behind that goes on
            found = {n: check for n, check in found.items() if -1 < n <= last}
            part.pop(-1)
        if found != part:
            wrong.append(f"from {start}")
    fill_new_memory(255)
    return wrong


def of_codec(name: str, trials: int, seed: int, size: tuple[int, int] = (176, 144)) -> Counter[str]:
    """Trials of one codec; prints each failure with the seed that makes it again."""
    av.logging.set_level(av.logging.PANIC)
    told: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        sound = make_clip(name, Path(folder), size=size)
        data = sound.read_bytes()
        for number in range(seed, seed + trials):
            rng = random.Random(f"{name}-{number}")
            mutant = Path(folder) / f"m{sound.suffix}"
            mutant.write_bytes(damaged(data, rng))
            wrong = trial(mutant, rng)
            told["trials"] += 1
            told["decodes"] += 4
            told["differ"] += bool(wrong)
            if wrong:
                print(f"{name} seed {number}: differs {', '.join(wrong)}", flush=True)
    return told


def main() -> int:
    """Run, codec by codec, and tell."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("codecs", nargs="*", default=list(CODECS))
    parser.add_argument("--trials", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--size", default="176x144")
    args = parser.parse_args()
    width, height = map(int, args.size.split("x"))
    total: Counter[str] = Counter()
    for name in args.codecs or CODECS:
        with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
            job = pool.submit(of_codec, name, args.trials, args.seed, (width, height))
            try:
                found = job.result(timeout=SECONDS * (1 + args.trials))
            except (TimeoutError, BrokenProcessPool) as error:
                found = Counter({"hung or dead": 1})
                print(f"{name}: {type(error).__name__}", flush=True)
                for process in multiprocessing.active_children():
                    process.kill()
        print(f"{name}: {dict(found)}", flush=True)
        total += found
    print(f"total: {dict(total)}")
    return 1 if total["differ"] or total["hung or dead"] else 0


if __name__ == "__main__":
    sys.exit(main())
