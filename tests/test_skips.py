"""The rule that a skip in CI is a failure."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
import skips
from clips import SHARED
from command import ENVIRONMENT

TESTS = {
    "one": "import pytest\n@pytest.mark.skipif(True, reason='{}')\ndef test(): pass\n",
    "module": "import pytest\npytest.importorskip('no_such', reason='{}')\ndef test(): pass\n",
}


@pytest.mark.parametrize("kind", TESTS)
@pytest.mark.parametrize(("reason", "code"), [("no browser", 1), ("extra vdp is missing", 0)])
def test_a_skip_fails_in_ci_only(tmp_path: Path, kind: str, reason: str, code: int) -> None:
    (tmp_path / "test_a.py").write_text(TESTS[kind].format(reason) + "def test_b(): pass\n")
    if kind == "module":
        (tmp_path / "test_c.py").write_text("def test_c(): pass\n")
    (tmp_path / "conftest.py").write_text(
        f"import sys\nsys.path.insert(0, {str(Path(skips.__file__).parent)!r})\n"
        "pytest_plugins = ['skips']\n"
    )
    command = (sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(tmp_path))
    for ci, expected in (("", 0), ("1", code)):
        environment = {**ENVIRONMENT, "ITMO_VIDEO_CI": ci}
        done = subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, text=True
        )
        assert bool(done.returncode) == bool(expected), done.stdout
        assert ("skipped in CI" in done.stdout) == bool(expected), done.stdout


def test_shared_data_is_no_excuse_where_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    is_here = SHARED.is_dir()
    assert (skips.fault("needs ../shared") is not None) == is_here
    assert all(entry.why for entry in skips.ALLOWED)
