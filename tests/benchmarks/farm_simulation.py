"""A film on a large farm, on paper: what overlap, stragglers, opening and writing cost.

    python tests/benchmarks/farm_simulation.py [--workers 1000] [--hours 2] [--gigabytes 40]

Chunks as itmo_video.cluster cuts them go in order to whoever is free. The costs of a frame are
options, as `roofline.py` measures them; their defaults are those of 2160p on a busy core of 2025.
Nothing is rendered. For each length of a chunk: the wall time, the share of the workers' time that
makes pictures, and where the rest goes.
"""

from __future__ import annotations

import argparse
import heapq
from dataclasses import dataclass

import numpy as np

from itmo_video.cluster.chunks import chunk_length
from itmo_video.motion.cut_detection import CUT_REACH
from itmo_video.motion.keyframes import lead_in

INTERVAL, SMOOTH = 5, 4  # the default preset's


@dataclass(frozen=True)
class Farm:
    """Seconds a frame or key, gigabytes, gigabytes a second of the shared store."""

    workers: int
    frames: int
    decode_s: float
    render_s: float
    key_s: float
    film_gb: float
    frame_gb: float
    store_gb_s: float
    slow_share: float
    slow_factor: float
    opens_whole: bool


def chunk_cost(farm: Farm, length: int) -> tuple[float, float]:
    """CPU seconds of a chunk: what its own frames need, and what comes on top for their window."""
    lead_keys, lead = lead_in(INTERVAL, SMOOTH)
    ahead = (SMOOTH + 1) * INTERVAL + CUT_REACH + 1
    more_keys = -(-lead_keys // INTERVAL) + SMOOTH + 1
    own = length * (farm.decode_s + farm.render_s + farm.key_s / INTERVAL)
    return own, (lead + ahead) * farm.decode_s + more_keys * farm.key_s


def simulate(farm: Farm, length: int, seed: int = 0) -> dict[str, float]:
    """Wall seconds and shares of all the workers' time until the last frame is written."""
    rng = np.random.default_rng(seed)
    speed = rng.lognormal(0, 0.1, farm.workers)
    slow = rng.random(farm.workers) < farm.slow_share
    speed[slow] /= farm.slow_factor
    read_gb = farm.film_gb if farm.opens_whole else 0.01
    opening = farm.workers * read_gb / farm.store_gb_s  # all open at once and share the store
    own, more = chunk_cost(farm, length)
    writing = length * farm.frame_gb * farm.workers / farm.store_gb_s  # as all write at a time
    free = [(opening, w) for w in range(farm.workers)]
    ends = np.full(farm.workers, opening)
    done = 0
    while done < farm.frames:
        at, worker = heapq.heappop(free)
        # Writing goes beside rendering: whichever is slower holds the chunk up.
        took = max((own + more) / speed[worker], writing)
        heapq.heappush(free, (at + took, worker))
        ends[worker] = at + took
        done += length
    wall = float(ends.max())
    whole = wall * farm.workers
    chunks = -(-farm.frames // length)
    busy = float((own + more) * (1 / speed).mean()) * chunks
    return {
        "wall s": wall,
        "pictures": own * chunks / whole,
        "overlap": more * chunks / whole,
        "opening": opening / wall,
        "writing, stragglers": max(0.0, 1 - busy / whole - opening / wall),
    }


def main() -> None:
    """Print a table for several lengths, with a film that is read whole and one that is not."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--workers", type=int, default=1000)
    parser.add_argument("--hours", type=float, default=2)
    parser.add_argument("--decode-ms", type=float, default=35)
    parser.add_argument("--render-ms", type=float, default=140)
    parser.add_argument("--key-ms", type=float, default=160)
    parser.add_argument("--gigabytes", type=float, default=40, help="of the film")
    parser.add_argument("--frame-mb", type=float, default=25, help="of an EXR, zip")
    parser.add_argument("--store-gb-s", type=float, default=50, help="of the store, all together")
    parser.add_argument("--slow", type=float, default=0.02, help="share of slow workers")
    args = parser.parse_args()
    frames = round(args.hours * 3600 * 24)
    planned = chunk_length(frames, args.workers, INTERVAL)
    names = ("wall s", "pictures", "overlap", "opening", "writing, stragglers")
    for whole in (True, False):
        farm = Farm(
            args.workers, frames, args.decode_ms / 1e3, args.render_ms / 1e3, args.key_ms / 1e3,
            args.gigabytes, args.frame_mb / 1e3, args.store_gb_s, args.slow, 4.0, whole,
        )  # fmt: skip
        print(f"\nThe film is {'read whole' if whole else 'not read whole'} by each worker:\n")
        print(f"| frames a chunk | {' | '.join(names)} |\n|{' ---: |' * (len(names) + 1)}")
        for length in sorted({20, planned, 100, 200, 400}):
            found = simulate(farm, length)
            shares = " | ".join(f"{found[name]:.0%}" for name in names[1:])
            mark = " (planned)" if length == planned else ""
            print(f"| {length}{mark} | {found['wall s']:.0f} | {shares} |")


if __name__ == "__main__":
    main()
