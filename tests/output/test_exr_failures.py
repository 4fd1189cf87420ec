"""EXR files that cannot be written: an OutputError, and nothing is left behind."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest
from exr_pictures import HEADER, picture
from python_run import run_python

from itmo_video.errors import OutputError
from itmo_video.output import atomic, exr

pytestmark = pytest.mark.usefixtures("loops")


# What cannot be written


def fails_to_write(path: Path, **kwargs: Any) -> OutputError:
    with pytest.raises(OutputError) as caught:
        exr.write_exr(path, picture(2, 2), HEADER, **kwargs)
    assert caught.value.where == str(path)
    assert caught.value.remedy
    return caught.value


def test_missing_folder(tmp_path: Path) -> None:
    assert "folder" in fails_to_write(tmp_path / "gone" / "a.exr").what


def test_target_is_a_folder(tmp_path: Path) -> None:
    (tmp_path / "a.exr").mkdir()
    fails_to_write(tmp_path / "a.exr")
    assert os.listdir(tmp_path) == ["a.exr"]


def test_name_too_long(tmp_path: Path) -> None:
    fails_to_write(tmp_path / ("x" * 300))
    assert os.listdir(tmp_path) == []


@pytest.mark.skipif(os.name == "nt", reason="POSIX rights")
def test_no_right(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if os.geteuid() != 0:
        tmp_path.chmod(0o500)
    else:  # root may write anywhere: let the system refuse by hand

        def refuse(*_: object) -> None:
            raise PermissionError(13, "Permission denied")

        monkeypatch.setattr(os, "replace", refuse)
    assert "permission" in fails_to_write(tmp_path / "a.exr").what
    tmp_path.chmod(0o700)
    assert os.listdir(tmp_path) == []


def test_an_interrupt_leaves_no_temporary_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    exr.write_exr(tmp_path / "a.exr", picture(2, 2), HEADER)
    before = (tmp_path / "a.exr").read_bytes()
    monkeypatch.setattr(os, "replace", interrupt)
    with pytest.raises(KeyboardInterrupt):
        exr.write_exr(tmp_path / "a.exr", picture(9, 9), HEADER)
    assert os.listdir(tmp_path) == ["a.exr"]
    assert (tmp_path / "a.exr").read_bytes() == before


WRITE_UNTIL_FULL = """
    import dataclasses, sys
    sys.path.insert(0, sys.argv[2])
    from exr_pictures import HEADER, is_whole, picture
    from itmo_video import errors
    from itmo_video.output import exr
    try:
        import resource
        if len(sys.argv) > 3:
            resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[3]),) * 2)
        head = dataclasses.replace(HEADER, compression="none")
        for number in range(50):
            size = 20 + 4 * number
            exr.write_exr(f"{sys.argv[1]}/{number}.exr", picture(size, size), head)
    except errors.OutputError as error:
        import os
        names = os.listdir(sys.argv[1])
        whole = [is_whole(f"{sys.argv[1]}/{name}") for name in names]
        reason = error.what.split(" (")[0].replace(" ", "-")
        print(number == len(names) > 0, all(whole), reason, error.exit_code)
"""


def test_file_size_limit(tmp_path: Path) -> None:
    done = run_python(WRITE_UNTIL_FULL, tmp_path, Path(__file__).parent, 20000)
    told = done.stdout.split()
    assert told == ["True", "True", "larger-than-files-may-be-here", "5"], done.stderr


def test_full_disk(tmp_path: Path) -> None:
    # In a mount name space of its own: the little disk is gone with the process.
    mount = f"mount -t tmpfs -o size=256k none '{tmp_path}' 2>/dev/null || exit 99; exec \"$@\""
    try:
        done = run_python(
            WRITE_UNTIL_FULL,
            tmp_path,
            Path(__file__).parent,
            prefix=("unshare", "-m", "sh", "-c", mount, "sh"),
        )
    except FileNotFoundError:
        pytest.skip("no unshare here to mount a small disk with")
    if done.returncode and not done.stdout:
        pytest.skip(f"a small disk cannot be mounted here: {done.stderr.strip()}")
    assert done.stdout.split() == ["True", "True", "no-space-left-on-the-disk", "5"], done.stderr


# Temporary names


def test_temp_names_tell_their_owner(tmp_path: Path) -> None:
    names = [atomic.temp_path(tmp_path / "a.exr").name for _ in range(3)]
    assert len(set(names)) == 3
    assert atomic.temp_owner(names[0]) == atomic.this_process(os.getpid())
    assert atomic.this_process(os.getpid()).pid == os.getpid()
    for other in ("a.exr", ".itmo-.tmp", ".itmo-h-b-1-2-3-4.exr", ".itmo-h-b-1-x-3-4.tmp"):
        assert atomic.temp_owner(other) is None
