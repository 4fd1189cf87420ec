"""In CI (`ITMO_VIDEO_CI` is set) a skipped test fails, unless this list says why it may be."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Generator
from typing import NamedTuple

import pytest
from clips import SHARED


class Allowed(NamedTuple):
    """A skip that is no failure in CI: what its reason says, when it may be, and why."""

    reason: str
    when: bool
    why: str


ALLOWED = (
    Allowed("extra vdp is", True, "PyTorch: some GB, and a release that not every Python has"),
    Allowed("ITMO_VIDEO_CLUSTER_FAULTS", True, "distributed logs more on a loaded machine"),
    Allowed("root may read everything", os.name != "nt" and os.geteuid() == 0, "CI may be root"),
    Allowed("needs ../shared", not SHARED.is_dir(), "an sdist has no such data beside it"),
    Allowed("could not import 'vapoursynth'", sys.version_info < (3, 12), "it has no wheels there"),
    Allowed("opentimelineio is not installed", sys.version_info >= (3, 14), "no wheels there yet"),
    Allowed("got empty parameter set", not SHARED.is_dir(), "a test for each file of ../shared"),
)


def fault(reason: str) -> str | None:
    """What is wrong with a skip for this reason, or None."""
    if any(re.search(entry.reason, reason) and entry.when for entry in ALLOWED):
        return None
    return f"skipped in CI ({reason}): install what it needs, or say in tests/skips.py why not"


def _judged(report: pytest.TestReport | pytest.CollectReport) -> None:
    if report.outcome != "skipped" or hasattr(report, "wasxfail"):
        return
    reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)
    if (said := fault(reason)) is not None:
        report.outcome, report.longrepr = "failed", said


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport() -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Judge a test that skips."""
    report = yield
    if os.environ.get("ITMO_VIDEO_CI"):
        _judged(report)
    return report


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report() -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """Judge a module that skips as a whole."""
    report = yield
    if os.environ.get("ITMO_VIDEO_CI"):
        _judged(report)
    return report


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip what needs ../shared where it is missing."""
    if item.get_closest_marker("shared") and not (SHARED / "data").is_dir():
        pytest.skip("needs ../shared")
