"""A cluster behind TLS: a client with the farm's certificate is let in, and no other."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest
from clips import REPOSITORY, exr_bytes, moving_scene, write_ffv1

from itmo_video import convert, make_settings
from itmo_video.cluster import dask_executor
from itmo_video.cluster.address import Tls
from itmo_video.errors import ClusterError

SETTINGS = make_settings("paper", lights=16, compression="zips")
pytestmark = [
    pytest.mark.timeout(120),
    pytest.mark.skipif(
        find_spec("distributed") is None,
        reason="Dask distributed (the extra `cluster`) is not installed",
    ),
    pytest.mark.skipif(shutil.which("openssl") is None, reason="no openssl to make certificates"),
]


def certificate(folder: Path, name: str) -> Path:
    """A key and a certificate that vouches for itself, in one PEM file."""
    key, cert, both = (folder / f"{name}{suffix}" for suffix in (".key", ".cert", ".pem"))
    subprocess.run(
        ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1",
         "-nodes", "-days", "2", "-subj", f"/CN={name}", "-keyout", key, "-out", cert,
         "-addext", "keyUsage=critical,digitalSignature,keyCertSign"],
        check=True, capture_output=True,
    )  # fmt: skip
    both.write_bytes(key.read_bytes() + cert.read_bytes())
    return both


@pytest.fixture
def farm(tmp_path: Path) -> Iterator[tuple[str, Path]]:
    """The address of a scheduler with one worker, and the certificate of all three."""
    pem, file = certificate(tmp_path, "farm"), tmp_path / "scheduler.json"
    with (tmp_path / "dask.log").open("wb") as log:

        def dask(name: str, *more: str) -> subprocess.Popen[bytes]:
            files = [f"--tls-{part}={pem}" for part in ("ca-file", "cert", "key")]
            return subprocess.Popen(
                [sys.executable, "-m", f"distributed.cli.dask_{name}", *files, "--no-dashboard",
                 "--scheduler-file", str(file), "--host", "tls://127.0.0.1", *more],
                cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
                stdout=log, stderr=subprocess.STDOUT,
            )  # fmt: skip

        processes = [dask("scheduler", "--port", "0")]
        try:
            until = time.monotonic() + 60
            while not (file.exists() and b'"address"' in file.read_bytes()):
                assert time.monotonic() < until, (tmp_path / "dask.log").read_text()
                time.sleep(0.02)
            processes.append(dask("worker", "--nthreads", "1", "--no-nanny"))
            yield file.read_text().split('"address": "')[1].split('"')[0], pem
        finally:
            for process in reversed(processes):
                process.kill()
                process.wait(timeout=20)


def test_the_holder_of_the_certificate_is_let_in_and_nobody_else(
    farm: tuple[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    address, pem = farm
    assert address.startswith("tls://127.0.0.1:")
    clip = write_ffv1(tmp_path / "c.mkv", moving_scene(6, width=64, height=48))
    convert(clip, tmp_path / "whole", SETTINGS)
    ours = Tls(str(pem), str(pem), str(pem))
    executor = dask_executor.cluster_executor(address, ours)
    assert convert(clip, tmp_path / "o", SETTINGS, executor=executor).written == 6
    assert exr_bytes(tmp_path / "o") == exr_bytes(tmp_path / "whole")

    monkeypatch.setattr(dask_executor, "WAIT_S", 3)
    strange = str(certificate(tmp_path, "stranger"))
    plain = address.replace("tls://", "tcp://")
    for told, where, tls in (
        ("a stranger's certificate", address, Tls(str(pem), strange, strange)),
        ("another authority", address, Tls(strange, strange, strange)),
        ("no encryption", plain, None),
    ):
        executor = dask_executor.cluster_executor(where, tls)
        with pytest.raises(ClusterError, match="no scheduler answers"):
            convert(clip, tmp_path / "refused", SETTINGS, executor=executor)
        assert exr_bytes(tmp_path / "refused") == {}, told
