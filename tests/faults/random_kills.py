"""kill -9 at random moments of the commands that write: run again, the bytes must be the same.

    PYTHONPATH=tests python tests/faults/random_kills.py [--kills 10] [--seed 0] [COMMAND...]

`--kills` is for each command. Wrong are other bytes, a part of a file that bears its name, and
temporary files and processes that stay. Of `--scheduler local` one time in two only the process in
front is killed, whose workers have to notice.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from clips import REPOSITORY, moving_scene, write_ffv1
from command import COMMAND, ENVIRONMENT

LIGHTS = ("--lights", "64", "--quiet")
LINES = {
    "convert": ("convert", "c.mkv", "out", *LIGHTS, "--durable"),
    "cluster": ("convert", "c.mkv", "out", *LIGHTS, "--durable", "--scheduler", "local"),
    "preview": ("preview", "c.mkv", "film.mkv", "--speed", "13", "--quiet"),
    "report": ("report", "made", "--output", "page.html", "--quiet"),
    "analyse": ("analyse", "c.mkv", "--output", "a.json", "--quiet"),
}
OUTPUTS = ("out", "film.mkv", "page.html", "a.json")


class Place:
    """A folder with a clip and a conversion of it, and a temporary folder of its own."""

    def __init__(self, folder: Path, frames: int = 40) -> None:
        self.folder, self.temp = folder / "work", folder / "tmp"
        for made in (self.folder, self.temp):
            made.mkdir()
        write_ffv1(self.folder / "c.mkv", moving_scene(frames, width=96, height=64))
        self.whole("convert", "c.mkv", "made", *LIGHTS)

    def start(self, *line: str) -> subprocess.Popen[bytes]:
        """Start a command in a session of its own."""
        return subprocess.Popen(
            [*COMMAND, *line],
            cwd=self.folder,
            env={**ENVIRONMENT, "PYTHONPATH": str(REPOSITORY), "TMPDIR": str(self.temp)},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            start_new_session=True,
        )

    def whole(self, *line: str) -> float:
        """Run a command to its end; the seconds that it took."""
        began = time.monotonic()
        process = self.start(*line)
        _, told = process.communicate(timeout=300)
        assert process.returncode == 0, told.decode()
        return time.monotonic() - began

    def output(self, line: tuple[str, ...]) -> Path:
        """What a command writes."""
        return self.folder / next(word for word in line if word in OUTPUTS)

    def strays(self) -> list[str]:
        """Temporary files and folders that are left."""
        ours = [path for path in self.folder.rglob("*") if path.name.endswith(".tmp")]
        return sorted(str(path) for path in [*ours, *self.temp.iterdir()])


def content(path: Path) -> dict[str, bytes]:
    """The files of a folder, or the one file."""
    if not path.is_dir():
        return {path.name: path.read_bytes()} if path.exists() else {}
    return {file.name: file.read_bytes() for file in sorted(path.iterdir())}


def in_session(leader: int) -> list[int]:
    """The processes of a session that are left."""
    found = []
    for entry in filter(str.isdigit, os.listdir("/proc")):
        try:
            fields = Path(f"/proc/{entry}/stat").read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[3]) == leader and fields[0] != "Z":
            found.append(int(entry))
    return found


def kills(place: Place, command: str, count: int, seed: int, told: Counter[str]) -> Iterator[str]:
    """What goes wrong; `told` counts the kills by what was there then."""
    line, rng = LINES[command], random.Random(f"{command} {seed}")
    output = place.output(line)
    remove(output)
    seconds = place.whole(*line)
    whole = content(output)
    for number in range(count):
        remove(output)
        process = place.start(*line)
        time.sleep(rng.uniform(0.1, 1) * seconds)
        is_alone = command == "cluster" and number % 2 == 0
        was_running = process.poll() is None
        if is_alone:
            process.kill()
        elif was_running:
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate(timeout=60)
        until = time.monotonic() + 60
        while (left := in_session(process.pid)) and time.monotonic() < until:
            time.sleep(0.05)
        if left:
            yield f"{command} {number}: processes {left} live on"
        there = content(output)
        told[f"{command}: {'killed' if was_running else 'too late'}"] += 1
        told[f"{command}: with temporary files"] += bool(place.strays())
        parts = [name for name in there if not name.endswith(".tmp") and there[name] != whole[name]]
        if parts:
            yield f"{command} {number}: {parts} bear their names"
        if output.is_file():  # whole: nothing is written over unasked
            remove(output)
        place.whole(*line)
        if content(output) != whole:
            yield f"{command} {number}: other bytes"
        if strays := place.strays():
            yield f"{command} {number}: {strays} stay"


def remove(output: Path) -> None:
    """Take an output away, be it a folder."""
    if output.is_dir():
        for file in output.iterdir():
            file.unlink()
        output.rmdir()
    output.unlink(missing_ok=True)


def main() -> int:
    """Run all and tell."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("commands", nargs="*", default=list(LINES))
    parser.add_argument("--kills", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    told, bad = Counter[str](), 0
    with tempfile.TemporaryDirectory() as folder:
        place = Place(Path(folder))
        for command in args.commands or LINES:
            for wrong in kills(place, command, args.kills, args.seed, told):
                bad += 1
                print(wrong, flush=True)
            print({key: n for key, n in told.items() if key.startswith(command)}, flush=True)
    print(f"{bad} failures")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
