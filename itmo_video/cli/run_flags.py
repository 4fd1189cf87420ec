"""Flags of how a command is run, which change no pixel."""

from __future__ import annotations

import argparse

from itmo_video.errors import UsageError


def add_run_options(parser: argparse.ArgumentParser) -> None:
    """Add the flags of `convert`'s run."""
    group = parser.add_argument_group("run")
    group.add_argument(
        "--frames", metavar="RANGES", help="numbers as in the file names: 1-100,200-300x2"
    )
    group.add_argument(
        "--start-number", type=int, default=1, metavar="N", help="of the first frame (1)"
    )
    group.add_argument("--jobs", type=positive, metavar="N", help="worker threads (the cores)")
    group.add_argument(
        "--overwrite", action="store_true", help="make all frames again, in any folder"
    )
    group.add_argument("--update", action="store_true", help="make again what other settings made")
    group.add_argument(
        "--verify", action="store_true", help="only check what is there; exit code 7"
    )
    group.add_argument("--durable", action="store_true", help="wait until each file is on the disk")
    group.add_argument("--null", action="store_true", help="make everything, write nothing")
    group.add_argument(
        "--dry-run", action="store_true", help="say what would be done and do nothing"
    )
    group.add_argument(
        "--max-pixels", type=positive, default=2**27, metavar="N", help="a frame, at most"
    )
    group.add_argument(
        "--scheduler", metavar="ADDRESS|local",
        help="on a Dask cluster, or on one of --jobs processes here (extra `cluster`)",
    )  # fmt: skip
    group.add_argument(
        "--analysis", metavar="FILE.json", help="the file of `analyse`, with its shots as edited"
    )
    group.add_argument("--quiet", action="store_true", help="no progress and no notices")
    group.add_argument(
        "--json", action="store_true", help="one line of JSON an event on standard output"
    )


def positive(text: str) -> int:
    """A whole number of 1 or more."""
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError("must be 1 or more")
    return value


def start_number(args: argparse.Namespace) -> int:
    """The number of the first frame, 0 or more; raises UsageError."""
    if args.start_number < 0:
        raise UsageError(f"start-number must be 0 or more, not {args.start_number}")
    return int(args.start_number)
