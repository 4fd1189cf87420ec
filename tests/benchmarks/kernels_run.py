"""What a figure of speed is worth depends on the compiled kernels: benchmarks ask for them."""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Sequence

PLAIN_HELP = "measure even where the compiled kernels do not run"


def add_plain(parser: argparse.ArgumentParser) -> None:
    """Add the flag that measures without the compiled kernels."""
    parser.add_argument("--plain", action="store_true", help=PLAIN_HELP)


def require_kernels(plain: bool, tool: Sequence[str] = (sys.executable, "-m", "itmo_video")) -> str:
    """Ask the very command that is measured; exit where its kernels do not run unless `plain`.

    Returns what it says of them, to stand beside the figures.
    """
    told = subprocess.run([*tool, "--version"], check=True, capture_output=True, text=True).stdout
    state = told.splitlines()[-1]
    if not plain and state != "compiled kernels: running":
        sys.exit(f"{state}\nNothing was measured; --plain measures without them.")
    return state
