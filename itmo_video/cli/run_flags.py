"""Flags for running a command that do not change pixels."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from itmo_video.cli.option_flags import add_options
from itmo_video.conversion.run_options import RunOptions

if TYPE_CHECKING:
    from itmo_video.cli.progress import Progress

OF_ANALYSE = ("frames", "start_number", "max_pixels", "overwrite", "jobs", "analysis")
OF_PREVIEW = OF_ANALYSE


def add_run_options(parser: argparse.ArgumentParser) -> None:
    """Add the flags of `convert`'s run."""
    group = parser.add_argument_group("run")
    add_options(group, RunOptions)
    group.add_argument(
        "--verify",
        action="store_true",
        help="only check the output; exit code 7 if it is incomplete or damaged",
    )
    group.add_argument(
        "--dry-run", action="store_true", help="only print frames, disk space and memory"
    )
    group.add_argument(
        "--scheduler", metavar="ADDRESS|local",
        help="run on a Dask cluster, or in --jobs local processes (extra `cluster`)",
    )  # fmt: skip
    for name, what in (("ca-file", "authority"), ("cert", "certificate"), ("key", "key")):
        group.add_argument(
            f"--tls-{name}", metavar="FILE.pem",
            help=f"{what} for --scheduler tls://..., as for `dask worker` (default: Dask's "
            "configuration)",
        )  # fmt: skip
    add_telling(group)


def add_telling(group: Any, *, has_json: bool = True) -> None:
    """Add the flags for reporting."""
    loud = group.add_mutually_exclusive_group()
    loud.add_argument("--quiet", action="store_true", help="print no progress and no notices")
    loud.add_argument(
        "--verbose",
        action="store_true",
        help="print the settings, and each frame as it is finished",
    )
    group.add_argument(
        "--log",
        metavar="FILE",
        help="append everything that --verbose prints to a file, with times",
    )
    if has_json:
        group.add_argument(
            "--json", action="store_true", help="print events as JSON lines on standard output"
        )


def progress_of(
    args: argparse.Namespace, about: str | None = None, place: str | None = None
) -> Progress:
    """A reporter by the flags of `add_telling`; of several inputs, `about` is this one."""
    from itmo_video.cli.progress import Progress

    return Progress(
        as_json=getattr(args, "json", False), quiet=args.quiet, is_verbose=args.verbose,
        log=args.log_file, about=about, place=place,
    )  # fmt: skip
