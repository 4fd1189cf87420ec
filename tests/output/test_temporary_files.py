"""Temporary files in a folder: whose go, and whose stay."""

from __future__ import annotations

import os
import random
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
from exr_pictures import HEADER
from folders import OURS, start_python

from itmo_video.output import atomic
from itmo_video.output.folder import OutputFolder
from itmo_video.output.manifest import MANIFEST_NAME

linux_only = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")


# Temporary files


def temp_name(owner: atomic.TempOwner, serial: int = 0) -> str:
    return f".itmo-{'-'.join(str(part) for part in owner)}-{serial}.tmp"


@pytest.fixture
def me() -> atomic.TempOwner:
    return atomic.this_process(os.getpid())


HOLD = """
    import os, sys
    from itmo_video.output import atomic
    path = atomic.temp_path(sys.argv[1] + "/clip.0001.exr")
    path.write_bytes(b"half")
    print(path.name, flush=True)
    sys.stdin.readline()
"""


@linux_only
def test_dead_owners_files_go_and_living_ones_stay(out: OutputFolder) -> None:
    out.claim(OURS)
    dead, living = (start_python(HOLD, out.path) for _ in range(2))
    try:
        dead_name, living_name = (worker.stdout.readline().strip() for worker in (dead, living))
        own = atomic.temp_path(out.frame_path(3))
        own.write_bytes(b"half")
        assert out.sweep_temp_files() == 0
        dead.send_signal(signal.SIGKILL)
        os.waitid(os.P_PID, dead.pid, os.WEXITED | os.WNOWAIT)  # dead, though not yet buried
        assert out.sweep_temp_files() == 1
        assert {dead_name, living_name, own.name, MANIFEST_NAME} - set(os.listdir(out.path)) == {
            dead_name
        }
        living.communicate("\n", timeout=20)
        assert out.sweep_temp_files() == 1
        assert sorted(os.listdir(out.path)) == sorted([own.name, MANIFEST_NAME])
    finally:
        for worker in (dead, living):
            worker.kill()
            worker.communicate(timeout=20)


WRITE_ON = """
    import itertools, sys
    sys.path.insert(0, sys.argv[2])
    from exr_pictures import HEADER, picture
    from itmo_video.output import exr, folder
    out = folder.OutputFolder(sys.argv[1], "clip")
    rgb = picture(200, 300)
    print("ready", flush=True)
    for number in itertools.count():
        exr.write_exr(out.frame_path(number % 7), rgb, HEADER)
"""


@linux_only
def test_killed_at_any_moment_all_frames_are_whole(out: OutputFolder) -> None:
    out.claim(OURS)
    rng = random.Random(0)
    for _ in range(6):
        worker = start_python(WRITE_ON, out.path, Path(__file__).parent)
        worker.stdout.readline()
        time.sleep(rng.uniform(0.01, 0.1))
        worker.kill()
        worker.communicate(timeout=20)
        numbers = out.frame_numbers()
        assert out.verify(dict.fromkeys(numbers, HEADER.fingerprint)) == []
        assert out.sweep_temp_files() <= 1
        assert len(os.listdir(out.path)) == len(numbers) + 1


@linux_only
def test_whose_temporary_files_go(out: OutputFolder, me: atomic.TempOwner) -> None:
    out.claim(OURS)
    boot = atomic.boot_time_s()
    assert 0 < boot < out.manifest_path.stat().st_mtime
    first = atomic.process_stat(1)
    assert first is not None
    start_of_first = first[1]
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    go = [
        temp_name(me._replace(pid=gone.pid)),
        temp_name(me._replace(start="1")),  # the number is used again
        temp_name(me._replace(boot="00000000", pid=1)),  # before the machine started anew
    ]
    stay = [
        temp_name(me),
        temp_name(me._replace(pid=1, start=start_of_first)),
        temp_name(me._replace(host="elsewhere", pid=gone.pid)),
        temp_name(me._replace(pids="1", pid=gone.pid)),  # in another container
        temp_name(me._replace(boot="00000000", pid=1), serial=1),  # a living namesake's
        temp_name(me._replace(boot="0", pid=gone.pid)),
        ".itmo-notes.tmp",
        ".clip.0001.exr.tmp",
        "clip.0001.exr",
    ]
    for name in go + stay:
        (out.path / name).write_bytes(b"")
    os.utime(out.path / go[2], (boot - 100, boot - 100))
    (out.path / temp_name(me._replace(pid=gone.pid), serial=9)).mkdir()
    assert out.sweep_temp_files() == len(go)
    left = set(os.listdir(out.path))
    assert left >= set(stay)
    assert not left & set(go)


def test_sweep_of_a_folder_that_is_not_there(out: OutputFolder) -> None:
    assert out.sweep_temp_files() == 0
    assert out.frame_numbers() == []


def test_a_forked_child_has_its_own_name() -> None:
    code = """
        import os
        from itmo_video.output import atomic
        mother = atomic.temp_path("a").name
        reader, writer = os.pipe()
        if os.fork() == 0:
            os.write(writer, atomic.temp_path("a").name.encode())
            os._exit(0)
        os.wait()
        child = os.read(reader, 999).decode()
        print(atomic.temp_owner(mother).pid == os.getpid() != atomic.temp_owner(child).pid)
    """
    if not hasattr(os, "fork"):
        pytest.skip("no fork here")
    assert start_python(code).communicate(timeout=20)[0].strip() == "True"


def test_strange_host_names(monkeypatch: pytest.MonkeyPatch) -> None:
    atomic.this_process.cache_clear()
    monkeypatch.setattr(socket, "gethostname", lambda: "my-host é/" + "x" * 300)
    name = atomic.temp_path("a").name
    atomic.this_process.cache_clear()
    assert len(name) < 200
    owner = atomic.temp_owner(name)
    assert owner is not None
    assert owner.host.startswith("my_host___x")
