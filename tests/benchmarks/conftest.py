"""`--plain` for the kernels' benchmark, too."""

from __future__ import annotations

import pytest
from kernels_run import PLAIN_HELP, require_kernels


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the flag that measures without the compiled kernels."""
    parser.addoption("--plain", action="store_true", help=PLAIN_HELP)


def pytest_configure(config: pytest.Config) -> None:
    """Measure nothing where the compiled kernels do not run, unless that is meant."""
    if not config.getoption("benchmark_disable", False):
        try:
            require_kernels(config.getoption("--plain"))
        except SystemExit as error:
            pytest.exit(str(error), returncode=2)
