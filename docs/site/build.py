"""Builds the site of docs/: python docs/site/build.py [TARGET], by default build/; strictly.

TARGET/docs is docs/ with what the pages need, TARGET/site the site. No network is used.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
ASSETS = ("iframe-worker.js", "site.css")


def stage(target: Path) -> None:
    """Write TARGET/docs and TARGET/mkdocs.yml, all that the site is built from."""
    staged = target / "docs"
    shutil.rmtree(staged, ignore_errors=True)
    shutil.copytree(HERE.parent, staged, ignore=shutil.ignore_patterns("site", "__pycache__"))
    (staged / "assets").mkdir()
    for name in ASSETS:
        shutil.copy(HERE / name, staged / "assets")
    shutil.copy(HERE / "mkdocs.yml", target)


def build(target: Path) -> Path:
    """Build the site and return its folder; raises CalledProcessError for a broken link."""
    target.mkdir(parents=True, exist_ok=True)
    stage(target)
    zensical = [sys.executable, "-c", "from zensical.main import cli; cli()"]
    subprocess.run([*zensical, "build", "--strict", "--clean"], cwd=target, check=True)
    return target / "site"


if __name__ == "__main__":
    wanted = sys.argv[1] if len(sys.argv) > 1 else HERE.parents[1] / "build"
    try:
        print(build(Path(wanted).absolute()))
    except subprocess.CalledProcessError as error:
        sys.exit(error.returncode)
