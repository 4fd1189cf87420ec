"""The command `studio`."""

from __future__ import annotations

import argparse
import sys
from typing import Any

from itmo_video.cli.config_file import options_said, preset_of, said, tell_config
from itmo_video.cli.option_flags import add_options, options_of
from itmo_video.cli.outcome import Terminated
from itmo_video.cli.settings_flags import add_settings
from itmo_video.conversion.run_options import RunOptions
from itmo_video.settings import Settings
from itmo_video.studio.studio_options import OF_RUN, StudioOptions


def add_studio(commands: Any) -> None:
    """Add the subcommand, with the settings' flags as `convert` has them."""
    parser = commands.add_parser(
        "studio",
        help="find the look interactively in the browser",
        description="Open a clip in a local web page: scrub, compare, try settings for the clip or "
        "for single shots, save them, render. Nothing leaves this machine. Ctrl-C stops it.",
    )
    parser.add_argument("clip", metavar="CLIP", help="a clip, still or image sequence")
    add_options(parser, StudioOptions)
    add_options(parser, RunOptions, OF_RUN)
    add_settings(parser, without=("raw",))  # a pipe, in which nobody can scrub
    parser.set_defaults(run=_run)


def _run(args: argparse.Namespace) -> int:
    from itmo_video.studio.document import Document
    from itmo_video.studio.opening import Opening
    from itmo_video.studio.serve import serve

    options, run = options_of(args, StudioOptions), options_said(args, RunOptions)
    opening = Opening()

    def on_ready(address: str) -> None:
        print(address, flush=True)
        if not options.no_browser:
            opening.open(address)

    tell_config(args, Settings, RunOptions)
    document = Document(preset_of(args), said(args, Settings), run.analysis)
    try:
        serve(args.clip, document, options, run, on_ready, opening.done)
    except KeyboardInterrupt:  # the usual way to stop it
        return _closed(0)
    except Terminated:
        return _closed(143)
    finally:
        opening.done()
    return 0


def _closed(code: int) -> int:
    print("itmo-video: the studio is closed", file=sys.stderr)
    return code
