"""The command `report`."""

from __future__ import annotations

import argparse
from typing import Any

from itmo_video.cli.option_flags import add_options, options_of
from itmo_video.html_report.report_options import ReportOptions


def add_report(commands: Any) -> None:
    """Add the subcommand."""
    parser = commands.add_parser(
        "report",
        help="write a self-contained HTML report (QC) of a conversion",
        description="Write a self-contained page about a converted folder: a viewer with read-outs "
        "in nits, light over time, light levels, settings.",
    )
    parser.add_argument("folder", metavar="OUTPUT_DIR", help="a converted folder")
    add_options(parser, ReportOptions)
    parser.add_argument("--quiet", action="store_true", help="print no progress")
    parser.set_defaults(run=_run)


def _run(args: argparse.Namespace) -> int:
    from itmo_video.cli.progress import Progress
    from itmo_video.html_report.page import report

    progress = Progress(as_json=False, quiet=args.quiet)
    path = report(args.folder, options_of(args, ReportOptions), progress.on_event)
    progress.close()
    print(path)
    return 0
