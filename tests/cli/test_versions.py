"""`--version` tells what a bug report needs; benchmarks refuse to measure without the kernels."""

from __future__ import annotations

import sys
from pathlib import Path

import kernels_run
import pytest
from command import run

from itmo_video.cli.main import main
from itmo_video.kernels import library


def test_version_tells_what_it_runs_with(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("itmo-video 0.")
    told = dict(line.split(" ", 1) for line in lines[1:-1])
    assert told["Python"].startswith(sys.version.split()[0])
    assert "with FFmpeg" in told["av"]
    assert {"numpy", "scipy", "opencv-contrib-python-headless"} <= set(told)
    assert "openexr" in {name.lower() for name in told}
    assert lines[-1] == f"compiled kernels: {library.state()}"


def test_the_module_is_the_command() -> None:
    done = run("--version", command=(sys.executable, "-W", "error", "-m", "itmo_video"))
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("itmo-video 0.")
    assert done.stderr == ""


@pytest.mark.parametrize(
    ("content", "said"), [(None, "was not built"), (b"no library", "not running")]
)
def test_why_the_kernels_do_not_run(
    content: bytes | None, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(library, "__file__", str(tmp_path / "library.py"))
    if content is not None:
        (tmp_path / "_native.so").write_bytes(content)
    library._found.cache_clear()
    try:
        assert library.library() is None
        assert said in library.state()
    finally:
        library._found.cache_clear()


@pytest.mark.parametrize("state", ["running", "not running: _native.so was not built"])
@pytest.mark.parametrize("plain", [False, True])
def test_benchmarks_ask_for_the_kernels(state: str, plain: bool) -> None:
    tool = [sys.executable, "-c", f"print('itmo-video 0'); print('compiled kernels: {state}')"]
    if state == "running" or plain:
        assert kernels_run.require_kernels(plain, tool) == f"compiled kernels: {state}"
        return
    with pytest.raises(SystemExit, match="--plain"):
        kernels_run.require_kernels(plain, tool)
