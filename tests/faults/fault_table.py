"""Every fault times every command that writes: the exit code, and what is left, are as promised.

    PYTHONPATH=tests python tests/faults/fault_table.py [FAULT...]

Wrong are another exit code than the table's, "unexpected", a traceback, more than a few lines, a
hang, temporary files, changed files of others, and, where the fault is past, other bytes from the
same command than from one that was never disturbed.
"""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from clips import moving_scene, write_ffv1
from command import COMMAND, ENVIRONMENT
from random_kills import content

LINES = {
    "convert": ("convert c.mkv {}", "new"),
    "film": ("preview c.mkv {} --speed 13", "new.mkv"),
    "hdr10 film": ("preview c.mkv {} --as hdr10 --speed 13", "new.mp4"),
    "film of a folder": ("preview made {} --codec prores", "new.mov"),
    "raw film": ("preview c.mkv {}", "new.y4m"),
    "still": ("preview c.mkv {} --frame 2", "new.png"),
    "avif still": ("preview c.mkv {} --frame 2", "new.avif"),
    "report": ("report made --output {}", "new.html"),
    "analyse": ("analyse c.mkv --output {}", "new.json"),
    "heat map": ("evaluate made --reference made --heat-map {}", "new.mp4"),
    "variants": ("variants c.mkv {} --vary peak-nits", "new.png"),
}
SHELL = " ".join(map(shlex.quote, COMMAND))


class Fault(NamedTuple):
    """How a command is run, with {line} and {out} (its file), in which a script lays the fault.

    `codes` are right; `is_past`: the same command again then gives what an undisturbed one does.
    """

    script: str
    codes: tuple[int, ...]
    is_past: bool = True


FAULTS = {
    "full disk": Fault(
        "mount -t tmpfs -o size=4k none box && head -c 4096 /dev/zero >box/full || exit 99; {line}",
        (5,),
    ),
    "read-only": Fault("mount -t tmpfs -o ro none box || exit 99; {line}", (5,)),
    "file size limit": Fault("ulimit -f 0; {line}", (5,)),
    "few files": Fault("ulimit -n 5; {line}", (0, 1, 3, 5)),
    "little memory": Fault("ulimit -v 260000; {line}", (1,)),
    "closed streams": Fault("{line} <&- >&- 2>&-", (0,)),
    "full streams": Fault("{line} >/dev/full 2>/dev/full", (0, 5)),
    "killed": Fault("{line} & sleep 0.7; kill -9 $!; wait $!; exit 0", (0,)),
    "no folder": Fault("rm -r box; {line}; code=$?; mkdir box; exit $code", (5, 0)),
    "pipe there": Fault("mkfifo {out}; {line}", (5,), False),
    "link to the source": Fault("ln -s ../c.mkv {out}; {line}", (5,), False),
    "link to nowhere": Fault("ln -s gone {out}; {line}", (5,), False),
    "somebody's file": Fault("echo mine > {out}; {line}", (5,), False),
}
NOT = tuple(  # to `preview` a pipe of any name is a stream of Y4M: it waits for its reader
    ("pipe there", name) for name, (line, _) in LINES.items() if line.startswith("preview")
)
QUICK = (
    ("full disk", "raw film"),
    ("read-only", "still"),
    ("file size limit", "film"),
    ("few files", "report"),
    ("little memory", "convert"),
    ("closed streams", "variants"),
    ("pipe there", "report"),
    ("link to the source", "heat map"),
    ("somebody's file", "convert"),
)


def make_place(folder: Path) -> Path:
    """A clip and a conversion of it."""
    write_ffv1(folder / "c.mkv", moving_scene(4, width=96, height=64))
    done = in_shell(folder, f"{SHELL} convert c.mkv made --quiet --lights 16")
    assert done.returncode == 0, done.stderr
    (folder / "box").mkdir()
    return folder


def in_shell(folder: Path, script: str) -> subprocess.CompletedProcess[str]:
    """Run a script in a name space of mounts of its own."""
    return subprocess.run(
        ["unshare", "-m", "bash", "-c", script],
        cwd=folder, env=ENVIRONMENT, capture_output=True, text=True, timeout=90, check=False,
    )  # fmt: skip


def wrong(place: Path, fault: str, command: str, whole: Callable[[str], object]) -> Iterator[str]:
    """What is not as promised; `whole` gives what an undisturbed run of a command makes."""
    said, name = LINES[command]
    out, how = f"box/{name}", FAULTS[fault]
    line = f"{SHELL} {said.format(out)}"
    others = {path: content(place / path) for path in ("c.mkv", "made")}
    try:
        done = in_shell(place, how.script.format(line=line, out=out))
    except subprocess.TimeoutExpired:
        yield "it hangs"
        return
    told = done.stderr
    if done.returncode not in how.codes:
        yield f"exit code {done.returncode}: {told[-300:]}"
    if "unexpected" in told or "Traceback" in told:
        yield told[-300:]
    if done.returncode and len([one for one in told.splitlines() if "warning" not in one]) > 4:
        yield f"{len(told.splitlines())} lines: {told[-600:]}"
    if {path: content(place / path) for path in others} != others:
        yield "it changed files of others"
    if fault == "somebody's file" and (place / out).read_text() != "mine\n":
        yield "it changed somebody's file"
    if how.is_past:
        again = in_shell(place, line)
        made = content(place / out)
        if again.returncode == 5 and "file exists" in again.stderr and made == whole(command):
            return  # it had been written, and nothing is written over unasked
        if again.returncode or made != whole(command):
            yield f"the same command again: exit code {again.returncode}, {again.stderr[-300:]}"
    if strays := [path.name for path in place.rglob("*.tmp")]:
        yield f"{strays} stay"


class Whole:
    """What undisturbed commands make, each run once."""

    def __init__(self, place: Path) -> None:
        self._place, self._made = place, dict[str, dict[str, bytes]]()

    def __call__(self, command: str) -> dict[str, bytes]:
        """The files by name."""
        if command not in self._made:
            said, name = LINES[command]
            (self._place / "whole").mkdir(exist_ok=True)
            out = self._place / "whole" / name
            out.unlink(missing_ok=True)
            done = in_shell(self._place, f"{SHELL} {said.format(f'whole/{name}')}")
            assert done.returncode == 0, done.stderr
            self._made[command] = content(out)
        return self._made[command]


def main() -> int:
    """Run the table and tell."""
    bad = trials = 0
    with tempfile.TemporaryDirectory() as folder:
        place = make_place(Path(folder))
        whole = Whole(place)
        for fault in sys.argv[1:] or FAULTS:
            for command in (name for name in LINES if (fault, name) not in NOT):
                if command == "heat map" and find_spec("torch") is None:
                    continue  # it needs the extra `vdp` to come so far
                shutil.rmtree(place / "box", ignore_errors=True)
                (place / "box").mkdir()
                trials += 1
                for what in wrong(place, fault, command, whole):
                    bad += 1
                    print(f"{fault}, {command}: {what}", flush=True)
            print(f"{fault}: done", flush=True)
    print(f"{trials} trials, {bad} wrong")
    return 1 if bad else 0


if __name__ == "__main__":
    os.environ.pop("XDG_CONFIG_HOME", None)
    sys.exit(main())
