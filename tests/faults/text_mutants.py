"""Mutants of manifests, analyses and presets through their readers, in one process.

    python tests/faults/text_mutants.py [--kind KIND] [--count 10000] [--seed 0] [--only NUMBER]

Mutant `n` is that of kind, seed and n alone, so `--only n` makes it again. Each is read as a
command does, to the settings of its last frame. Wrong is any error that is none of ours, one that
takes over five seconds, and 2 GB more memory.
"""

from __future__ import annotations

import argparse
import json
import random
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType
from typing import Any

from clips import moving_scene, write_ffv1
from fuzz import mutate
from peak_memory import forget_peak, peak_kb

from itmo_video import analyse, convert, make_settings, read_analysis
from itmo_video.conversion.plan import shot_looks
from itmo_video.conversion.run_options import RunOptions
from itmo_video.errors import ItmoError
from itmo_video.output.converted import find_converted
from itmo_video.output.manifest import MANIFEST_NAME
from itmo_video.presets import preset_folder
from itmo_video.source.opening import open_clip

MEMORY_BYTES, SECONDS = 2 << 30, 5
KINDS = ("manifest", "analysis", "preset")
_VALUES = (
    "null", "true", "-1", "0", "1e308", "-0.0", "1e-400", "9" * 25, "0.1", '""', '"zip"', "[]",
    "{}", '[[]]', "[0, 1, {}]", '{"a": 1}', '"\\ud800"', '"\\u0000"', "NaN", "1e999", "[" * 70,
    '"../../x"', '"auto"', "4", "inf", "1979-05-27", "'x'", '"""', "0x10", "2_0",
)  # fmt: skip

_PLAIN: tuple[Any, ...] = (
    None, True, False, -1, 0, 1, 2, 7, 10**25, 1e308, -0.5, 0.1, 1e-9, "", "auto", "zip", "x" * 999,
    "\ud800", "\0", "../x", [], {}, [[]], [0, 1, {}], {"a": 1}, [1, 2, 3], "1/0", "25",
)  # fmt: skip


class _HangError(BaseException):
    """It takes too long."""


def originals(kind: str, folder: Path) -> list[bytes]:
    """Sound files of a kind, made in `folder`."""
    if kind == "preset":
        more = b"[settings]\noperator-params = { threshold = 0.7 }\nlayers = ['gain']\nfps = '25'\n"
        return [*(path.read_bytes() for path in sorted(preset_folder().glob("*.toml"))), more]
    clip = folder / "c.mkv"
    found = analyse(clip)
    shots = json.loads(found.to_json())
    shots["shots"][0] |= {"peak_nits": 600, "preset": "paper"}
    shots["shots"][-1] |= {"enabled": False, "operator_params": {}}
    if kind == "analysis":
        return [found.to_json().encode(), json.dumps(shots).encode()]
    (folder / "shots.json").write_text(json.dumps(shots))
    run = RunOptions(frames="1", analysis=read_analysis(folder / "shots.json"))
    convert(clip, folder / "with_shots", make_settings("paper", lights=16), run)
    convert(clip, folder / "o", make_settings("paper", lights=16), RunOptions(frames="1"))
    return [(folder / name / MANIFEST_NAME).read_bytes() for name in ("o", "with_shots")]


def _change_tree(tree: Any, rng: random.Random) -> None:
    """One value somewhere in parsed JSON replaced, removed, repeated or moved."""
    while True:
        at: Any = rng.choice(list(tree)) if isinstance(tree, dict) else rng.randrange(len(tree))
        inside = tree[at]
        if not (isinstance(inside, dict | list) and inside) or rng.random() < 0.2:
            break
        tree = inside
    what = rng.randrange(5)
    if what == 0:
        tree[at] = rng.choice(_PLAIN)
    elif what == 1:
        tree[at] = tree[rng.choice(list(tree))] if isinstance(tree, dict) else tree[-1]
    elif what == 2 and isinstance(tree, dict):
        tree[f"{at}{rng.choice(('', '-', '_x'))}".replace("_", "-")] = inside
    elif what == 3 and isinstance(tree, list):
        tree.extend([inside] * rng.choice((1, 300)))
    elif len(tree) > 1:
        del tree[at]


def mutant(original: bytes, rng: random.Random) -> bytes:
    """Bytes changed, or words of the text replaced by others that readers trip over."""
    kind = rng.random()
    if kind < 0.2:
        return mutate(original, rng)
    if kind < 0.6 and original.startswith(b"{"):
        tree = json.loads(original)
        for _ in range(rng.choice((1, 1, 2, 4))):
            _change_tree(tree, rng)
        return json.dumps(tree).encode("utf-8", "surrogatepass")
    parts = original.decode("utf-8", "replace")
    for _ in range(rng.choice((1, 1, 2, 3))):
        words = [(0, len(parts))]
        at = 0
        for mark in ": ", " = ", ", ", "\n":
            at = parts.find(mark, rng.randrange(max(1, len(parts))))
            if at >= 0:
                ends = [end for end in (parts.find(c, at + 2) for c in ",\n}]") if end > 0]
                words.append((at + len(mark), min(ends, default=len(parts))))
        begin, end = rng.choice(words[1:] or words)
        what = rng.randrange(4)
        if what == 0:
            parts = parts[:begin] + rng.choice(_VALUES) + parts[end:]
        elif what == 1:
            parts = parts[:begin] + parts[end:]
        elif what == 2:
            parts = parts[:end] + parts[begin:end] * rng.choice((1, 2, 40)) + parts[end:]
        else:
            other = rng.randrange(max(1, len(parts)))
            parts = parts[:begin] + parts[other : other + rng.choice((3, 9, 30))] + parts[end:]
    return parts.encode("utf-8", "replace")


def readers(folder: Path) -> dict[str, Callable[[bytes], object]]:
    """What reads each kind as far as a command would without rendering."""
    info = open_clip(folder / "c.mkv").info

    def manifest(data: bytes) -> object:
        (folder / "o" / MANIFEST_NAME).write_bytes(data)
        found = find_converted(folder / "o")
        if found is not None and found.files:
            _ = found.peak_nits, found.absent, found.notices, found.settings_of(found.numbers[-1])
            found.read(found.numbers[-1])
        return found

    def analysis(data: bytes) -> object:
        (folder / "a.json").write_bytes(data)
        return shot_looks(info, make_settings(), read_analysis(folder / "a.json"))

    def preset(data: bytes) -> object:
        (folder / "p.toml").write_bytes(data)
        return make_settings(str(folder / "p.toml"))

    return {"manifest": manifest, "analysis": analysis, "preset": preset}


def failures(
    kind: str, count: int, seed: int, only: int | None = None
) -> Iterator[tuple[int, str]]:
    """(number, what is wrong) of the mutants that were not read or refused as they should be."""

    def too_long(signum: int, frame: FrameType | None) -> None:
        raise _HangError

    codes: Counter[str] = Counter()
    slowest, already_kb = 0.0, forget_peak()
    before = signal.signal(signal.SIGALRM, too_long)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_ffv1(folder / "c.mkv", moving_scene(6, width=32, height=24, cuts=(3,)))
        sound = originals(kind, folder)
        (folder / "o").mkdir(exist_ok=True)
        read = readers(folder)[kind]
        for number in range(count) if only is None else (only,):
            rng = random.Random(f"{kind} {seed} {number}")
            data = mutant(rng.choice(sound), rng)
            if only is not None:
                print(data.decode("utf-8", "replace"))
            began = time.process_time()
            signal.alarm(60)
            try:
                read(data)
                codes["read"] += 1
            except ItmoError as error:
                codes[f"exit {error.exit_code}"] += 1
                if error.exit_code not in (2, 3) or len(str(error)) > 2000:
                    yield number, f"exit code {error.exit_code}: {str(error)[:3000]}"
            except _HangError:
                yield number, "it hangs"
            except Exception:
                yield number, traceback.format_exc()
            finally:
                signal.alarm(0)
            taken = time.process_time() - began
            slowest = max(slowest, taken)
            if taken > SECONDS:
                yield number, f"it takes {taken:.1f} s"
            if (peak_kb() - already_kb) * 1024 > MEMORY_BYTES:
                yield number, "it takes 2 GB more"
                break
    signal.signal(signal.SIGALRM, before)
    peak = peak_kb() >> 10
    print(kind, dict(codes), f"slowest {slowest:.2f} s, {peak} MB", file=sys.stderr)


def main() -> int:
    """Run all and tell."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kind", choices=KINDS)
    parser.add_argument("--count", type=int, default=10000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", type=int)
    args = parser.parse_args()
    bad = 0
    for kind in KINDS if args.kind is None else (args.kind,):
        for number, what in failures(kind, args.count, args.seed, args.only):
            bad += 1
            print(f"{kind} {number}: {what[-1500:]}", flush=True)
    print(f"{bad} failures")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
