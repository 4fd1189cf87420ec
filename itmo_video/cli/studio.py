"""`itmo-video studio`: its flags, and what it prints."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from itmo_video.cli.run_flags import positive, start_number
from itmo_video.cli.settings_flags import add_settings, overrides_of


def add_studio(commands: Any) -> None:
    """Add the subcommand, with the settings' flags as `convert` has them."""
    parser = commands.add_parser(
        "studio",
        help="a page in the browser to find the look by looking",
        description="Open a clip in a page on this machine: scrub, compare, try settings for the "
        "clip or for single shots, save them, render. Nothing leaves the machine. End it with "
        "Ctrl-C.",
    )
    parser.add_argument("clip", metavar="CLIP", help="a clip, still or image sequence")
    add_settings(parser)
    group = parser.add_argument_group("studio")
    group.add_argument(
        "--analysis", metavar="FILE.json", help="a shot list to begin with (default: find the cuts)"
    )
    group.add_argument(
        "--folder", metavar="DIR", default=".", help="where files are saved and rendered to (.)"
    )
    group.add_argument("--port", type=int, default=0, metavar="N", help="a free one unless given")
    group.add_argument("--no-browser", action="store_true", help="only print the page's address")
    group.add_argument(
        "--start-number", type=int, default=1, metavar="N", help="of the first frame (1)"
    )
    group.add_argument(
        "--max-pixels", type=positive, default=2**27, metavar="N",
        help="refuse frames with more than N pixels",
    )  # fmt: skip
    parser.set_defaults(run=_run)


def _run(args: argparse.Namespace) -> int:
    import webbrowser

    from itmo_video.analysis.reading import read_analysis
    from itmo_video.studio.document import Document
    from itmo_video.studio.serve import serve

    analysis = read_analysis(args.analysis) if args.analysis else None

    def on_ready(address: str) -> None:
        print(address, flush=True)
        if not args.no_browser:
            webbrowser.open(address)

    serve(
        args.clip,
        Document(args.preset, overrides_of(args), analysis),
        Path(args.folder).resolve(),
        port=args.port,
        start_number=start_number(args),
        max_pixels=args.max_pixels,
        on_ready=on_ready,
    )
    return 0
