"""Atomic writing of files: temporary names that identify their owner, and renames.

A temporary file belongs to the process in its name, and nobody else removes it while that process
lives (`is_dead`), so several processes and machines may write into one folder.
"""

from __future__ import annotations

import errno
import functools
import itertools
import os
import re
import shutil
import socket
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from itmo_video.errors import OutputError
from itmo_video.regular_file import StrPath


class TempOwner(NamedTuple):
    """The process that owns a temporary file; `boot`, `pids` and `start` disambiguate its pid.

    `boot` identifies the machine's boot, `pids` the pid namespace (containers), `start` the
    process's start in clock ticks after boot; "0" if the system does not provide it.
    """

    host: str
    boot: str
    pids: str
    pid: int
    start: str


_serial = itertools.count()


def temp_path(path: StrPath) -> Path:
    """A unique name for a temporary file of this process next to `path`."""
    owner = "-".join(str(part) for part in this_process(os.getpid()))
    # Not derived from `path`'s name, which may already have the maximum length.
    return Path(path).parent / f".itmo-{owner}-{next(_serial)}.tmp"


def temp_owner(name: str) -> TempOwner | None:
    """The owner of the temporary file `name`; None if it is not named like one of ours."""
    match = re.fullmatch(r"\.itmo-([\w.]+)-(\w+)-(\d+)-(\d+)-(\d+)-\d+\.tmp", name)
    if match is None:
        return None
    host, boot, pids, pid, start = match.groups()
    return TempOwner(host, boot, pids, int(pid), start)


@functools.lru_cache(maxsize=1)  # by pid, so that a forked child does not use its parent's
def this_process(pid: int) -> TempOwner:
    """Identify this process as an owner."""
    boot = pids = "0"
    with suppress(OSError):
        boot = Path("/proc/sys/kernel/random/boot_id").read_text()[:8]
        pids = re.sub(r"\D", "", os.readlink("/proc/self/ns/pid")) or "0"
    host = re.sub(r"[^\w.]", "_", socket.gethostname(), flags=re.ASCII)[:63] or "_"
    start = (process_stat(pid) or ("", "0"))[1]
    return TempOwner(host, boot, pids, pid, start)


def process_stat(pid: int) -> tuple[str, str] | None:
    """The state letter and start time of process `pid`; None if Linux does not provide them."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return None
    return fields[0], fields[19]


def is_dead(owner: TempOwner, written_s: float) -> bool:
    """Whether the owner of a temporary file, last modified at `written_s`, is gone."""
    me = this_process(os.getpid())
    if owner.host != me.host:
        return False
    if owner.boot != me.boot:
        # This machine before a reboot, or another with the same name, whose files are recent.
        return "0" not in (owner.boot, me.boot) and written_s < boot_time_s()
    if owner.pids != me.pids or os.name == "nt":
        return False
    try:
        os.kill(owner.pid, 0)  # only checks; sees processes that a hardened /proc hides
    except ProcessLookupError:
        return True
    except OSError:
        pass
    stat = process_stat(owner.pid)
    # Pids are reused by processes that started later; a zombie no longer writes.
    return stat is not None and (stat[1] != owner.start or stat[0] in "ZX")


def boot_time_s() -> float:
    """The machine's boot time in seconds of the Unix epoch; 0 if unknown."""
    with suppress(OSError):
        match = re.search(r"^btime (\d+)", Path("/proc/stat").read_text(), re.MULTILINE)
        if match:
            return float(match[1])
    return 0.0


def sweep_temp_files(folder: StrPath) -> int:
    """Remove temporary files in `folder` of dead processes on this machine; return their number.

    Files of running processes, other machines and other containers stay. Raises OutputError if the
    folder cannot be listed; a missing folder has none.
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


def sweep_temp_folders(folder: StrPath) -> None:
    """Remove the temporary folders in `folder` of dead processes of this machine, if possible."""
    with suppress(OSError):
        for entry in os.scandir(folder):
            owner = temp_owner(entry.name)
            if owner and entry.is_dir(follow_symlinks=False):
                with suppress(OSError):  # another process may sweep at the same time
                    if is_dead(owner, entry.stat(follow_symlinks=False).st_mtime):
                        shutil.rmtree(entry.path, ignore_errors=True)


def write_whole(path: StrPath, data: bytes | memoryview, *, durable: bool = False) -> int:
    """Write `data` to `path` as `write_parts` does."""
    return write_parts(path, (data,), durable=durable)


def write_parts(
    path: StrPath, parts: Iterable[bytes | memoryview], *, durable: bool = False
) -> int:
    """Write `parts` to `path` via a temporary file and return the size in bytes.

    Each part is written before the next is requested. Readers see either the old file or the
    complete new one. Raises OutputError if it cannot be written; the temporary file is always
    removed.
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
    finally:  # after the rename there is nothing to remove
        with suppress(OSError):
            temp.unlink()
    return size


def _sync_folder(folder: Path) -> None:
    if os.name == "nt":  # Windows cannot open folders
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


NO_SPACE = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
RUN_AGAIN = "then run the same command again"
RESUMES = f"{RUN_AGAIN} to resume"


def output_error(error: OSError, path: StrPath, then: str = RESUMES) -> OutputError:
    """An OutputError for a failure to write `path`, with a remedy, the last part of it `then`."""
    again = f"{then}."
    if error.errno in NO_SPACE:
        is_limit = error.errno == errno.EFBIG
        what = "larger than files may be here" if is_limit else "no space left on the disk"
        remedy = f"{'Raise the limit (ulimit -f)' if is_limit else 'Free some space'}, {again}"
    elif error.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
        what, remedy = (
            "permission denied",
            f"Change the permissions or choose another folder, {again}",
        )
    elif error.errno == errno.ENOTDIR:
        what, remedy = "a file is in the way of a folder", "Choose another folder."
    elif error.errno == errno.ENOENT:
        what, remedy = "the folder does not exist (any more)", f"Restore the folder, {again}"
    else:
        what, remedy = "cannot be written", f"Check the disk, {again}"
    return OutputError(f"{what} ({error.strerror})", where=os.fspath(path), remedy=remedy)
