"""Mutated files through the command: no crash, hang, traceback, or file outside the folder.

    python tests/faults/fuzz.py FILE... [--count 2000] [--seed 0]

Each of the mutants (bit flips, cuts, header edits of the files named, seeded) is converted by a
process of its own with 2 GB of memory and 20 s.
"""

from __future__ import annotations

import argparse
import random
import resource
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

MEMORY_BYTES = 2 << 30
SECONDS = 20
EXPECTED = {0, 3, 4, 6}


def mutate(data: bytes, rng: random.Random) -> bytes:
    """One mutant: flipped bits, a cut, an edited header, a block moved, removed or repeated."""
    out = bytearray(data)
    size = len(out)
    for _ in range(rng.choice((1, 1, 2, 4))):
        kind = rng.randrange(6)
        at = rng.randrange(max(1, len(out)))
        length = rng.choice((1, 4, 16, 200))
        if kind == 0:
            for _ in range(rng.choice((1, 8, 64))):
                i = rng.randrange(max(1, len(out)))
                out[i : i + 1] = bytes([out[i] ^ (1 << rng.randrange(8))]) if i < len(out) else b""
        elif kind == 1:
            del out[max(1, at) :]
        elif kind == 2:
            head = rng.randrange(min(size, 4096) or 1)
            out[head : head + 4] = rng.randbytes(4)
        elif kind == 3:
            head = rng.randrange(min(size, 4096) or 1)
            out[head : head + 4] = rng.choice((b"\xff" * 4, b"\0" * 4, b"\x7f\xff\xff\xff"))
        elif kind == 4:
            del out[at : at + length]
        else:
            out[at:at] = out[at : at + length]
        if not out:
            out = bytearray(b"\0")
    return bytes(out)


def run_one(mutant: Path, folder: Path) -> tuple[int, str]:
    """Exit code and standard error of a conversion; code 124 when it hangs."""

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))

    command = [sys.executable, "-m", "itmo_video", "convert", str(mutant), str(folder / "out")]
    try:
        run = subprocess.run(
            [*command, "--quiet", "--jobs", "1", "--compression", "none"],
            capture_output=True,
            timeout=SECONDS,
            preexec_fn=limit,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return 124, "it hangs"
    return run.returncode, run.stderr.decode("utf-8", "replace")


def failures(files: list[Path], count: int, seed: int) -> Iterator[tuple[int, str, str]]:
    """(number, what is wrong, standard error) of mutants that were not treated as they should."""
    rng = random.Random(seed)
    codes: Counter[int] = Counter()
    for number in range(count):
        original = files[number % len(files)]
        data = mutate(original.read_bytes(), rng)
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            mutant = folder / f"m{original.suffix}"
            mutant.write_bytes(data)
            code, errors = run_one(mutant, folder)
            codes[code] += 1
            strays = [p.name for p in folder.iterdir() if p.name not in (mutant.name, "out")]
            if code not in EXPECTED:
                yield number, f"{original.name}: exit code {code}", errors
            elif "Traceback" in errors:
                yield number, f"{original.name}: a traceback", errors
            elif strays:
                yield number, f"{original.name}: files outside the folder: {strays}", errors
    print(dict(codes), file=sys.stderr)


def main() -> int:
    """Run all and tell."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--count", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    bad = 0
    for number, what, errors in failures(args.files, args.count, args.seed):
        bad += 1
        print(f"mutant {number}: {what}\n{errors}")
    print(f"{args.count} mutants, {bad} failures")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
