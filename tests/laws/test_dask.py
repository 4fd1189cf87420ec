"""Dask: workers, schedulers and addresses that fail, and a real one."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from clips import REPOSITORY
from cluster_runs import SETTINGS
from command import broken_frames, start, temp_files
from same_bytes import assert_same_bytes

from itmo_video import convert
from itmo_video.cli.main import main
from itmo_video.cluster import chunks, dask_executor
from itmo_video.errors import (
    ClusterError,
)
from itmo_video.events import Event, FrameDone

FLAGS = ("--lights", 64, "--radius", 64, "--compression", "zips")

needs_dask = pytest.mark.skipif(
    __import__("importlib.util").util.find_spec("distributed") is None,
    reason="Dask distributed (the extra `cluster`) is not installed",
)
pytestmark = pytest.mark.timeout(90)


faults = pytest.mark.skipif(
    not os.environ.get("ITMO_VIDEO_CLUSTER_FAULTS"),
    reason="set ITMO_VIDEO_CLUSTER_FAULTS: on a loaded machine distributed sometimes logs more",
)


def wait_until(is_so: Callable[[], object], what: str) -> None:
    until = time.monotonic() + 120
    while not is_so():
        assert time.monotonic() < until, f"waited too long for {what}"
        time.sleep(0.005)


def worker_pids(pid: int) -> list[int]:
    import psutil  # type: ignore[import-untyped]  # comes with distributed, without its stubs

    children = psutil.Process(pid).children(recursive=True)
    return [c.pid for c in children if any("spawn_main" in part for part in c.cmdline())]


def frames_in(folder: Path) -> int:
    return len(list(folder.glob("*.exr")))


# With Dask


@needs_dask
def test_local_with_a_worker_killed(clip: Path, whole: dict[str, bytes], tmp_path: Path) -> None:
    local = ("--scheduler", "local", "--jobs", 2, "--durable", "--json")
    process = start("convert", clip, tmp_path, *FLAGS, *local)
    try:
        wait_until(lambda: frames_in(tmp_path) >= 8 or process.poll() is not None, "frames")
        assert process.poll() is None, process.communicate()
        pids = worker_pids(process.pid)
        assert len(pids) == 2, "--jobs 2 means two worker processes"
        os.kill(pids[0], signal.SIGKILL)
        assert frames_in(tmp_path) < 110, "killed too late to show anything"
        out, told = process.communicate(timeout=180)
    finally:
        process.kill()
    assert process.returncode == 0, told
    assert out.count('"event": "frame"') == 120
    assert_same_bytes(tmp_path, whole, "a killed worker leaves another folder")


@needs_dask
@faults
@pytest.mark.parametrize(("sent", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_local_interrupted(
    sent: signal.Signals, code: int, clip: Path, whole: dict[str, bytes], tmp_path: Path
) -> None:
    local = ("--scheduler", "local", "--jobs", 2, "--durable", "--json")
    process = start("convert", clip, tmp_path, *FLAGS, *local, start_new_session=True)
    try:
        wait_until(lambda: frames_in(tmp_path) or process.poll() is not None, "a frame")
        pids = worker_pids(process.pid)
        os.killpg(process.pid, sent)  # as a terminal does
        _, told = process.communicate(timeout=30)
    finally:
        process.kill()
    assert process.returncode == code, told
    told = "".join(line for line in told.splitlines(True) if "tracemalloc" not in line)
    assert told.count("\n") <= 4, f"more than notices and the last word: {told}"
    assert broken_frames(tmp_path) == temp_files(tmp_path) == []
    assert not [pid for pid in pids if Path(f"/proc/{pid}").exists()], "workers live on"
    convert(clip, tmp_path, SETTINGS)
    assert_same_bytes(tmp_path, whole, "another folder")


@needs_dask
def test_local_without_its_folder(clip: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    local = ("--scheduler", "local", "--jobs", 2, "--durable", "--json", "--quiet")
    process = start("convert", clip, out, *FLAGS, *local)
    try:
        wait_until(lambda: frames_in(out) or process.poll() is not None, "a frame")
        out.rename(tmp_path / "moved")
        _, told = process.communicate(timeout=180)
    finally:
        process.kill()
    assert process.returncode == 5, told
    assert "same command again" in told
    told = "".join(line for line in told.splitlines(True) if "tracemalloc" not in line)
    assert told.count("\n") == 2, f"an error is two lines, from a worker, too: {told}"
    assert broken_frames(tmp_path / "moved") == []
    assert not out.exists()


@pytest.fixture
def dask(tmp_path: Path) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """A scheduler and two workers on the loopback address, as separate processes."""
    file, log = tmp_path / "scheduler.json", (tmp_path / "dask.log").open("wb")
    environment = {**os.environ, "PYTHONPATH": str(REPOSITORY)}

    def dask_process(name: str, *args: str) -> subprocess.Popen[bytes]:
        module = f"distributed.cli.dask_{name}"
        command = [sys.executable, "-m", module, "--scheduler-file", str(file), *args]
        return subprocess.Popen(
            command, cwd=tmp_path, env=environment, stdout=log, stderr=subprocess.STDOUT
        )

    processes = [dask_process("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")]
    try:
        wait_until(lambda: file.exists() and b'"address"' in file.read_bytes(), "the scheduler")
        worker = ("--host", "127.0.0.1", "--nthreads", "1", "--no-nanny", "--no-dashboard")
        processes += [dask_process("worker", *worker) for _ in range(2)]
        address = file.read_text().split('"address": "')[1].split('"')[0]
        yield address, processes
    finally:
        for process in reversed(processes):
            process.kill()
            process.wait(timeout=20)
        log.close()


@needs_dask
def test_a_real_scheduler_and_workers(
    dask: tuple[str, list[subprocess.Popen[bytes]]],
    clip: Path,
    whole: dict[str, bytes],
    tmp_path: Path,
) -> None:
    address, processes = dask
    out = tmp_path / "out"
    process = start("convert", clip, out, *FLAGS, "--scheduler", address, "--durable", "--json")
    try:
        wait_until(lambda: out.exists() and frames_in(out) >= 8, "frames")
        processes[1].kill()
        assert frames_in(out) < 110, "killed too late to show anything"
        _, told = process.communicate(timeout=180)
    finally:
        process.kill()
    assert process.returncode == 0, told
    assert_same_bytes(out, whole, "a real cluster with a killed worker makes another folder")


@needs_dask
@faults
@pytest.mark.parametrize("lost", ["workers", "scheduler"])
def test_a_lost_cluster_does_not_hang(
    lost: str,
    dask: tuple[str, list[subprocess.Popen[bytes]]],
    clip: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    address, processes = dask
    out = tmp_path / "out"
    monkeypatch.setattr(dask_executor, "WAIT_S", 2)
    monkeypatch.setattr(chunks, "chunk_length", lambda *about: chunks.SHORTEST)  # several a worker

    def on_event(event: Event) -> None:
        if isinstance(event, FrameDone):
            for process in processes[1:] if lost == "workers" else processes[:1]:
                process.kill()

    with pytest.raises(ClusterError, match=r"no workers|scheduler is gone") as caught:
        convert(clip, out, SETTINGS, None, on_event, dask_executor.cluster_executor(address))
    assert "same command again" in str(caught.value)
    assert broken_frames(out) == []


@needs_dask
def test_nobody_answers(clip: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dask_executor, "WAIT_S", 0.5)
    with pytest.raises(ClusterError, match="no scheduler answers") as caught:
        convert_on(clip, tmp_path, "tcp://127.0.0.1:9")
    assert "same command again" in str(caught.value)


@needs_dask
@pytest.mark.parametrize(
    "address",
    ["nonsense://", "nohost.invalid:1", "tcp://nohost.invalid:8786", "localhost", "tcp://:8786",
     "tcp://127.0.0.1:99999", "127.0.0.1:x", "", "tcp://a b:1", "inproc://x"],
)  # fmt: skip
def test_a_bad_address_is_wrong_usage_and_leaves_nothing(
    address: str, clip: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    began = time.monotonic()
    assert main(["convert", str(clip), str(tmp_path / "o"), "--scheduler", address]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 2
    assert time.monotonic() - began < dask_executor.WAIT_S
    assert not (tmp_path / "o").exists()


@needs_dask
def test_certificates_are_checked_before_the_work(
    clip: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    line = ["convert", str(clip), str(tmp_path / "o")]
    (tmp_path / "no.pem").write_text("no certificate")
    files = ["--tls-ca-file", str(tmp_path / "no.pem"), "--tls-cert", str(tmp_path / "gone.pem")]
    for more, told in (
        (["--scheduler", "tls://127.0.0.1:8786"], "needs certificates"),
        (["--scheduler", "tls://127.0.0.1:8786", *files], "cannot be used"),
        (["--scheduler", "tcp://127.0.0.1:8786", *files], "need an encrypted scheduler"),
        (files, "need a scheduler"),
    ):
        assert main([*line, *more]) == 2
        assert told in capsys.readouterr().err
    assert not (tmp_path / "o").exists()


def convert_on(clip: Path, out: Path, address: str) -> None:
    convert(clip, out, SETTINGS, executor=dask_executor.cluster_executor(address))
