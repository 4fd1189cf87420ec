"""Folders, manifests and processes for tests of output folders."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap
from typing import Any

import pytest
from clips import REPOSITORY

from itmo_video.errors import OutputError
from itmo_video.output.folder import OutputFolder
from itmo_video.output.manifest import Manifest

ENVIRONMENT = {**os.environ, "PYTHONPATH": str(REPOSITORY)}
OURS = Manifest("a.mp4", "d1", "clip", {"alpha": 0.5, "operator": "banterle2006"})


def changed(**values: Any) -> Manifest:
    return Manifest(**{**vars(OURS), **values})


def start_python(code: str, *args: object) -> Any:
    """A process, with pipes (which `Popen` does not say)."""
    return subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(code), *map(str, args)],
        env=ENVIRONMENT,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


def refused(out: OutputFolder, manifest: Manifest, *words: str, **options: Any) -> None:
    before = {path: path.read_bytes() for path in out.path.iterdir() if path.is_file()}
    for act in (out.check, out.claim):
        with pytest.raises(OutputError) as caught:
            act(manifest, **options)
        assert caught.value.exit_code == 5
        assert caught.value.where
        assert caught.value.remedy
        assert all(word in str(caught.value) for word in words), str(caught.value)
    assert before == {path: path.read_bytes() for path in out.path.iterdir() if path.is_file()}
