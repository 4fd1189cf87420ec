"""Files that appear whole or not at all: temporary names that name their owner, and renames.

A temporary file belongs to the process in its name, and is removed by nobody else while
that one lives (`is_dead`): several processes and machines may write into one folder.
"""

from __future__ import annotations

import errno
import functools
import itertools
import os
import re
import socket
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from itmo_video.errors import OutputError

StrPath = str | os.PathLike[str]


class TempOwner(NamedTuple):
    """The process that a temporary file belongs to; `boot`, `pids` and `start` tell pids apart.

    `boot` is of the machine's run, `pids` the name space that `pid` counts in (containers), `start`
    the process's start in clock ticks after boot; "0" where the system does not tell.
    """

    host: str
    boot: str
    pids: str
    pid: int
    start: str


_serial = itertools.count()


def temp_path(path: StrPath) -> Path:
    """Name a temporary file of this process beside `path`; never the same name twice."""
    owner = "-".join(str(part) for part in this_process(os.getpid()))
    # Not made of `path`'s own name, which may have the file system's full length already.
    return Path(path).parent / f".itmo-{owner}-{next(_serial)}.tmp"


def temp_owner(name: str) -> TempOwner | None:
    """Return whose temporary file `name` is; None when it is not named like one of ours."""
    match = re.fullmatch(r"\.itmo-([\w.]+)-(\w+)-(\d+)-(\d+)-(\d+)-\d+\.tmp", name)
    if match is None:
        return None
    host, boot, pids, pid, start = match.groups()
    return TempOwner(host, boot, pids, int(pid), start)


@functools.lru_cache(maxsize=1)  # by pid, so that a forked child does not take its parent's name
def this_process(pid: int) -> TempOwner:
    """Describe this process, whose number is `pid`."""
    boot = pids = "0"
    with suppress(OSError):
        boot = Path("/proc/sys/kernel/random/boot_id").read_text()[:8]
        pids = re.sub(r"\D", "", os.readlink("/proc/self/ns/pid")) or "0"
    host = re.sub(r"[^\w.]", "_", socket.gethostname(), flags=re.ASCII)[:63] or "_"
    start = (process_stat(pid) or ("", "0"))[1]
    return TempOwner(host, boot, pids, pid, start)


def process_stat(pid: int) -> tuple[str, str] | None:
    """Return the state letter and start time of process `pid`; None where Linux does not tell."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return None
    return fields[0], fields[19]


def is_dead(owner: TempOwner, written_s: float) -> bool:
    """Tell whether the process that made a temporary file, last written at `written_s`, is gone."""
    me = this_process(os.getpid())
    if owner.host != me.host:
        return False
    if owner.boot != me.boot:
        # This machine before it started anew, or a living one of the same name: then it is fresh.
        return "0" not in (owner.boot, me.boot) and written_s < boot_time_s()
    if owner.pids != me.pids or os.name == "nt":
        return False
    try:
        os.kill(owner.pid, 0)  # asks only; sees processes that a hardened /proc hides
    except ProcessLookupError:
        return True
    except OSError:
        pass
    stat = process_stat(owner.pid)
    # A number is used again by other processes, which started later; a zombie writes no more.
    return stat is not None and (stat[1] != owner.start or stat[0] in "ZX")


def boot_time_s() -> float:
    """Return when this machine started, in seconds of the Unix epoch; 0 where nobody tells."""
    with suppress(OSError):
        match = re.search(r"^btime (\d+)", Path("/proc/stat").read_text(), re.MULTILINE)
        if match:
            return float(match[1])
    return 0.0


def sweep_temp_files(folder: StrPath) -> int:
    """Remove the temporary files in `folder` of this machine's dead processes; return how many.

    Those of living processes, of other machines and of other containers stay. Raises OutputError
    where the folder cannot be listed; one that is not there has none.
    """
    try:
        names = os.listdir(folder or ".")
    except (FileNotFoundError, NotADirectoryError):
        return 0
    except OSError as error:
        raise output_error(error, folder) from error
    swept = 0
    for name in names:
        owner = temp_owner(name)
        with suppress(OSError):  # another process may sweep at the same time
            if owner and is_dead(owner, os.stat(os.path.join(folder, name)).st_mtime):
                os.unlink(os.path.join(folder, name))
                swept += 1
    return swept


def write_whole(path: StrPath, data: bytes | memoryview, *, durable: bool = False) -> int:
    """Put `data` at `path` as `write_parts` does."""
    return write_parts(path, (data,), durable=durable)


def write_parts(
    path: StrPath, parts: Iterable[bytes | memoryview], *, durable: bool = False
) -> int:
    """Put `parts` at `path` by way of a temporary file and return its size in bytes.

    Each part is written before the next is asked for. Whoever looks sees the old file or the whole
    new one. Raises OutputError when it cannot be written; the temporary file is removed whatever
    goes wrong.
    """
    temp = temp_path(path)
    size = 0
    try:
        with open(temp, "xb") as file:
            for part in parts:
                size += file.write(part)
            if durable:
                file.flush()
                os.fsync(file.fileno())
        os.replace(temp, path)
        if durable:
            _sync_folder(temp.parent)
    except OSError as error:
        raise output_error(error, path) from error
    finally:  # after the rename there is nothing left to remove
        with suppress(OSError):
            temp.unlink()
    return size


def _sync_folder(folder: Path) -> None:
    if os.name == "nt":  # folders cannot be opened there
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def output_error(error: OSError, path: StrPath) -> OutputError:
    """An OutputError for a failure to write `path`, in the user's words, with the remedy."""
    again = "then run the same command again: it resumes where it stopped."
    if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
        what, remedy = "no space left to write it", f"Free some space, {again}"
    elif error.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
        what, remedy = (
            "permission denied",
            f"Change the permissions or choose another folder, {again}",
        )
    elif error.errno in (errno.ENOENT, errno.ENOTDIR):
        what, remedy = "its folder does not exist (any more)", f"Restore the folder, {again}"
    else:
        what, remedy = "it cannot be written", f"Look at the disk, {again}"
    return OutputError(f"{what} ({error.strerror})", where=os.fspath(path), remedy=remedy)
