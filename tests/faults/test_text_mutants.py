"""A short run of text_mutants.py; docs/files_measured.md has the counts of a long one."""

from __future__ import annotations

import pytest
from text_mutants import KINDS, failures


@pytest.mark.parametrize("kind", KINDS)
def test_mutants_are_read_or_refused(kind: str) -> None:
    bad = list(failures(kind, 60, seed=1))
    assert not bad, f"mutants went wrong: {bad}"
