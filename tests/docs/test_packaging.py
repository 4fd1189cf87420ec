"""What the distribution says about itself."""

from __future__ import annotations

import tomllib
from importlib.resources import files

from clips import REPOSITORY

from itmo_video.conversion.plan import ALGORITHM

PROJECT = tomllib.loads((REPOSITORY / "pyproject.toml").read_text("utf-8"))["project"]


def test_the_changelog_knows_the_algorithm() -> None:
    """Whoever raises ALGORITHM says in CHANGELOG.md what changed."""
    rows = (REPOSITORY / "CHANGELOG.md").read_text("utf-8").splitlines()
    numbers = [int(row.split("|")[1]) for row in rows if row[:2] == "| " and row[2].isdigit()]
    assert numbers == list(range(ALGORITHM, 0, -1))


def test_the_citation_is_of_this_version() -> None:
    lines = (REPOSITORY / "CITATION.cff").read_text("utf-8").splitlines()
    assert f"version: {PROJECT['version']}" in lines
    assert "license: MIT" in lines


def test_types_are_for_importers() -> None:
    assert (files("itmo_video") / "py.typed").is_file()
    assert "Typing :: Typed" in PROJECT["classifiers"]


def test_classifiers_and_ci_name_the_same_pythons() -> None:
    """Each Python that we claim is run by .ci/run where it is found."""
    line = next(r for r in (REPOSITORY / ".ci/run").read_text().splitlines() if "supported=" in r)
    run = line.split("(")[1].rstrip(")").split()
    versions = [c.rsplit(" ", 1)[1] for c in PROJECT["classifiers"] if ":: Python :: 3." in c]
    assert set(versions) <= set(run)
    assert PROJECT["requires-python"] == f">={versions[0]}"
