"""The notebook in docs/ runs, and prints what it says it prints."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import nbformat
import pytest
from clips import REPOSITORY
from nbclient import NotebookClient

NOTEBOOK = REPOSITORY / "docs" / "guide" / "library.ipynb"


@pytest.mark.filterwarnings("ignore::DeprecationWarning:zmq", "ignore::ResourceWarning")
def test_the_notebook_runs_and_its_printed_lines_hold(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("IPYTHONDIR", "JUPYTER_CONFIG_DIR", "JUPYTER_DATA_DIR", "JUPYTER_RUNTIME_DIR"):
        monkeypatch.setenv(name, str(tmp_path / name.lower()))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    # What tornado says of its own loop on Python 3.12 and 3.13 is none of the notebook's.
    quiet = "ignore:There is no current event loop:DeprecationWarning"
    monkeypatch.setenv("PYTHONWARNINGS", f"error,{quiet}")
    notebook = nbformat.read(NOTEBOOK, as_version=4)  # type: ignore[no-untyped-call]  # it has no types
    stored = [printed(cell) for cell in notebook.cells]
    NotebookClient(
        notebook,
        timeout=200,
        kernel_name="python3",
        resources={"metadata": {"path": str(NOTEBOOK.parent)}},
    ).execute()
    assert [printed(cell) for cell in notebook.cells] == stored
    assert sum("image/" in str(cell.get("outputs")) for cell in notebook.cells) == 4


def printed(cell: Any) -> str:
    """What a cell prints, on standard output and error."""
    outputs = cell.get("outputs", [])
    return "".join(part["text"] for part in outputs if part["output_type"] == "stream")
