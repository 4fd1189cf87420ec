"""The command `preview`: its flags and options."""

from __future__ import annotations

import argparse
import os
import sys
from typing import Any

from itmo_video.cli.config_file import options_said, tell_config
from itmo_video.cli.option_flags import add_options, given
from itmo_video.cli.progress import failure_told
from itmo_video.cli.run_flags import OF_PREVIEW, add_telling, progress_of
from itmo_video.cli.settings_flags import add_settings, in_words, settings_of
from itmo_video.conversion.run_options import RunOptions
from itmo_video.delivery.preview_options import OF_ENCODING, OF_VIEW, PreviewOptions
from itmo_video.errors import UsageError
from itmo_video.settings import Settings

EXAMPLES = """\
examples:
  itmo-video preview clip.mp4 film.mp4
  itmo-video preview out/ film.mov --codec prores --source clip.mp4
  itmo-video preview clip.mp4 master.mp4 --quality high
  itmo-video preview clip.mp4 frame.avif --frame 100
  itmo-video preview clip.mp4 both.mp4 --as compare --layout wipe
  cat clip.mkv | itmo-video preview - - | x265 --y4m - -o film.hevc ...
"""


def add_preview(commands: Any) -> None:
    """Add the subcommand, with the settings' flags as `convert` has them."""
    parser = commands.add_parser(
        "preview",
        help="encode an HDR10, HLG or SDR film or still from a clip or a converted folder",
        description="Encode an HDR10 or HLG film, or a view for SDR monitors. A clip is converted "
        "on the fly with the settings below; a converted folder is shown as converted.",
        epilog=EXAMPLES,
    )
    parser.add_argument(
        "preview_source",
        metavar="SOURCE",
        help="a clip, a converted folder, or - for standard input",
    )
    parser.add_argument(
        "output",
        metavar="OUTPUT",
        help="a film (.mp4 .mov .mkv .y4m), a still (.avif .png .tif .jpg), or - for Y4M to a pipe",
    )
    view = parser.add_argument_group("view")
    add_options(view, PreviewOptions, OF_VIEW)
    coding = parser.add_argument_group("encoding")
    add_options(coding, PreviewOptions, (*OF_ENCODING, "hdr10plus"))
    add_settings(parser)
    group = parser.add_argument_group("run")
    add_options(group, RunOptions, OF_PREVIEW)
    add_telling(group)
    parser.set_defaults(run=_run)


def _run(args: argparse.Namespace) -> int:
    from itmo_video.delivery.preview import preview

    source = args.preview_source
    is_said = args.preset is not None or bool(given(args, Settings))
    settings = settings_of(args) if is_said or not os.path.isdir(source) else None
    run, options = options_said(args, RunOptions), options_said(args, PreviewOptions)
    tell_config(args, *([] if settings is None else [Settings]), RunOptions, PreviewOptions)
    to_pipe = args.output == "-"
    if to_pipe and args.json:
        raise UsageError(
            "--json cannot be used with a film to standard output", remedy="Omit --json."
        )
    progress = progress_of(args)
    if settings is not None:
        progress.detail(in_words(settings))
    told = failure_told(source, to_programs=args.json)
    with told, progress.on(source) as on_event:
        summary = preview(source, args.output, settings, run, options, on_event)
    if summary.max_cll and not (args.quiet or args.json):
        print(
            f"MaxCLL {summary.max_cll:.0f} nits, MaxFALL {summary.max_fall:.1f} nits",
            file=sys.stderr if to_pipe else sys.stdout,
        )
    return 0
