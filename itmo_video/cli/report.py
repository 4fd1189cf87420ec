"""`itmo-video report`: its flags."""

from __future__ import annotations

import argparse
from typing import Any


def add_report(commands: Any) -> None:
    """Add the subcommand."""
    parser = commands.add_parser(
        "report",
        help="one self-contained HTML page about a conversion",
        description="Write a page about a converted folder: a viewer with read-outs in nits, light "
        "over time, light levels, settings. It works from the disk and asks nothing of a network.",
    )
    parser.add_argument("folder", metavar="OUTPUT_DIR", help="a converted folder")
    parser.add_argument("--output", metavar="FILE.html", help="OUTPUT_DIR/report.html unless given")
    parser.add_argument(
        "--source", metavar="CLIP", help="the clip it was made of: before and after"
    )
    parser.add_argument("--overwrite", action="store_true", help="replace FILE.html")
    parser.add_argument("--quiet", action="store_true", help="no progress")
    parser.set_defaults(run=_run)


def _run(args: argparse.Namespace) -> int:
    from itmo_video.cli.progress import Progress
    from itmo_video.report.page import write_report

    progress = Progress(as_json=False, quiet=args.quiet)
    path = write_report(
        args.folder, args.output, args.source, progress.on_event, overwrite=args.overwrite
    )
    print(path)
    return 0
