"""Whatever ends a run, what is on the disk is whole, and the same command again ends the same."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from clips import exr_bytes, moving_scene, write_ffv1
from cluster_runs import files
from command import COMMAND, broken_frames, run, start, temp_files, wait_for_frames
from same_bytes import assert_same_bytes

ROUNDS = int(os.environ.get("ITMO_VIDEO_KILL_ROUNDS", "5"))
SEED = int(os.environ.get("ITMO_VIDEO_KILL_SEED", "2006"))
FLAGS = ("--lights", 64, "--radius", 64, "--compression", "zips")
# --durable changes no byte but makes each file take longer, so that a kill may well hit one.
SLOWLY = (*FLAGS, "--durable", "--json", "--quiet")

pytestmark = pytest.mark.skipif(os.name == "nt", reason="POSIX signals")


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    frames = moving_scene(80, width=192, height=108, cuts=(17, 18, 40))
    return write_ffv1(tmp_path_factory.mktemp("clip") / "scene.mkv", frames)


@pytest.fixture(scope="module")
def whole(clip: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """All files of an undisturbed run's folder, by name."""
    out = tmp_path_factory.mktemp("whole")
    done = run("convert", clip, out, *FLAGS)
    assert done.returncode == 0, done.stderr
    return files(out)


def goes_on(clip: Path, out: Path, whole: dict[str, bytes], after: str) -> None:
    done = run("convert", clip, out, *FLAGS)
    assert done.returncode == 0, f"after {after} the same command fails: {done.stderr}"
    assert_same_bytes(out, whole, f"after {after} the folder is not that of an undisturbed run")


def test_kill_9_at_random_moments(clip: Path, whole: dict[str, bytes], tmp_path: Path) -> None:
    rng = random.Random(SEED)
    out = tmp_path / "out"
    seen = []
    began = time.monotonic()
    run("convert", clip, tmp_path / "timed", *FLAGS)
    seconds = time.monotonic() - began
    for round_ in range(ROUNDS):
        process = start("convert", clip, out, *SLOWLY)
        if round_ % 2:  # from anywhere in the run's start, or from among its frames
            wait_for_frames(process, 1)
            time.sleep(rng.uniform(0, 0.25))
        else:
            time.sleep(rng.uniform(0, seconds))
        process.kill()
        process.communicate(timeout=20)
        seen.append((len(list(out.glob("*.exr"))), len(temp_files(out)) if out.exists() else 0))
        if out.exists():
            assert broken_frames(out) == [], f"kill number {round_} left a frame that is not whole"
            if process.returncode == 0 or seen[-1][0] > 60:  # it was too quick for this round
                for path in rng.sample(sorted(out.glob("*.exr")), 50):
                    path.unlink()
    print(f"frames and temporary files after each kill: {seen}")
    goes_on(clip, out, whole, f"{ROUNDS} kills")


@pytest.mark.parametrize(("sent", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_interrupted(
    sent: signal.Signals, code: int, clip: Path, whole: dict[str, bytes], tmp_path: Path
) -> None:
    process = start("convert", clip, tmp_path, *FLAGS, "--durable", "--json")
    wait_for_frames(process, 5)
    process.send_signal(sent)
    _, told = process.communicate(timeout=30)
    assert process.returncode == code, told
    assert "to resume" in told, "it must say how to resume"
    assert "Traceback" not in told
    assert temp_files(tmp_path) == []
    assert broken_frames(tmp_path) == []
    assert set(files(tmp_path)) < set(whole), "the signal came too late to show anything"
    goes_on(clip, tmp_path, whole, sent.name)


def in_small_disk(folder: Path, size: str, script: str, *args: object) -> None:
    """Run a shell script with a tmpfs on `folder`, gone afterwards; skip where none can be."""
    mount = f"mount -t tmpfs -o size={size} none '{folder}' 2>/dev/null || exit 99\n{script}"
    try:
        done = run(*args, command=("unshare", "-m", "sh", "-c", mount, "sh"))
    except FileNotFoundError:
        pytest.skip("no unshare here to mount a small disk with")
    if done.returncode == 99 or "unshare failed" in done.stderr:
        pytest.skip(f"a small disk cannot be mounted here: {done.stderr.strip()}")
    assert done.returncode == 0, done.stderr


def test_full_disk(clip: Path, whole: dict[str, bytes], tmp_path: Path) -> None:
    disk, kept, after = tmp_path / "disk", tmp_path / "kept", tmp_path / "after"
    for folder in (disk, kept, after):
        folder.mkdir()
    script = f"""
        "$@" 2> '{tmp_path}/told'; echo $? > '{tmp_path}/code'
        cp -a '{disk}/.' '{kept}'
        mount -o remount,size=64m '{disk}' && "$@" || exit 1
        cp -a '{disk}/.' '{after}'
    """
    in_small_disk(disk, "600k", script, *COMMAND, "convert", clip, disk, *FLAGS)
    assert (tmp_path / "code").read_text().strip() == "5", "a full disk is exit code 5"
    told = (tmp_path / "told").read_text()
    assert "no space left" in told, told
    assert "same command again" in told, told
    assert 0 < len(list(kept.glob("*.exr"))) < 80
    assert broken_frames(kept) == [], "a frame was left half written on the full disk"
    assert temp_files(kept) == []
    assert_same_bytes(after, whole, "going on after space was made gives other bytes")


def test_file_size_limit(clip: Path, whole: dict[str, bytes], tmp_path: Path) -> None:
    in_order = [len(data) for name, data in whole.items() if name.endswith(".exr")]
    # The largest files do not fit; the first frames' do, whoever packs them.
    limit = max(sorted(in_order)[-10], *in_order[:3])
    assert limit < max(in_order)
    limited = (
        "import resource, sys; from itmo_video.cli.main import main; "
        f"resource.setrlimit(resource.RLIMIT_FSIZE, ({limit},) * 2); "
        "sys.exit(main(sys.argv[1:]))"
    )
    done = run("convert", clip, tmp_path, *FLAGS, command=(sys.executable, "-c", limited))
    assert done.returncode == 5, done.stderr
    assert "larger than files may be here" in done.stderr
    assert 0 < len(list(tmp_path.glob("*.exr"))) < 80
    assert broken_frames(tmp_path) == temp_files(tmp_path) == []
    goes_on(clip, tmp_path, whole, "a file-size limit")


def test_folder_taken_away_in_mid_run(clip: Path, whole: dict[str, bytes], tmp_path: Path) -> None:
    out, moved = tmp_path / "out", tmp_path / "moved"
    process = start("convert", clip, out, *FLAGS, "--durable", "--json")
    wait_for_frames(process, 5)
    out.rename(moved)
    _, told = process.communicate(timeout=30)
    assert process.returncode == 5, told
    assert "does not exist" in told, told
    assert "same command again" in told, told
    assert not out.exists(), "a folder that somebody removed must not come back by itself"
    assert broken_frames(moved) == []
    moved.rename(out)
    goes_on(clip, out, whole, "the folder came back")


def test_no_right(clip: Path, whole: dict[str, bytes], tmp_path: Path) -> None:
    command = (*COMMAND, "convert", clip, tmp_path, *FLAGS)
    some = ("--frames", "1-3")
    if os.geteuid() == 0:  # root may write anywhere but on a disk that is read-only
        script = f"""
            "$@" {" ".join(some)} || exit 1
            mount -o remount,ro '{tmp_path}'
            "$@" 2>&1 | grep -q 'permission denied' || exit 2
            "$@"; test $? -eq 5
        """
        in_small_disk(tmp_path, "64m", script, *command)
        return
    assert run("convert", clip, tmp_path, *FLAGS, *some).returncode == 0
    tmp_path.chmod(0o500)
    done = run("convert", clip, tmp_path, *FLAGS)
    tmp_path.chmod(0o700)
    assert (done.returncode, "permission denied" in done.stderr) == (5, True), done.stderr
    goes_on(clip, tmp_path, whole, "the right came back")


def test_ranges_at_once_in_one_folder(clip: Path, whole: dict[str, bytes], tmp_path: Path) -> None:
    ranges = [f"{first}-{first + 19}" for first in range(1, 81, 20)]
    random.Random(4).shuffle(ranges)
    processes: list[subprocess.Popen[str]] = []
    for text in ranges:
        processes.append(start("convert", clip, tmp_path, *FLAGS, "--jobs", 1, "--frames", text))
        if len(processes) == 2:  # one alone, two on top of each other, one that comes late
            processes[0].communicate(timeout=60)
    for process in processes[1:]:
        _, told = process.communicate(timeout=60)
        assert process.returncode == 0, told
    assert exr_bytes(tmp_path) == {n: d for n, d in whole.items() if n.endswith(".exr")}, (
        "ranges by separate processes do not make up the whole"
    )
    assert_same_bytes(tmp_path, whole, "the manifest or temporary files differ")
