"""The command `variants`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from itmo_video.cli.config_file import preset_of, said, tell_config
from itmo_video.cli.option_flags import add_options, options_of
from itmo_video.cli.settings_flags import add_settings
from itmo_video.conversion.run_options import RunOptions
from itmo_video.events import Event, Warned
from itmo_video.settings import Settings
from itmo_video.studio.variants_options import VariantsOptions

EXAMPLES = """\
examples:
  itmo-video variants clip.mp4 presets.png
  itmo-video variants clip.mp4 peaks.html --frame 120 --vary peak-nits
  itmo-video variants clip.mp4 strengths.png --vary strength --values 0.5,1,1.5
"""


def add_variants(commands: Any) -> None:
    """Add the subcommand, with the settings' flags as `convert` has them."""
    parser = commands.add_parser(
        "variants",
        help="write a contact sheet of presets, or of values of one setting",
        description="Show variants of one frame side by side, tone-mapped for SDR monitors, as a "
        "picture or an HTML page.",
        epilog=EXAMPLES,
    )
    parser.add_argument("clip", metavar="CLIP", help="a clip, still or image sequence")
    parser.add_argument("output", metavar="OUT", help="a picture (.png .jpg) or a page (.html)")
    add_options(parser, VariantsOptions)
    add_options(parser, RunOptions, ("start_number", "max_pixels"))
    add_settings(parser)
    parser.set_defaults(run=_run)


def _run(args: argparse.Namespace) -> int:
    from itmo_video.studio.contact_sheet import contact_sheet

    options, run = options_of(args, VariantsOptions), options_of(args, RunOptions)
    output = Path(args.output)
    tell_config(args, Settings)
    changed = said(args, Settings)
    contact_sheet(args.clip, output, preset_of(args), changed, options, run, _tell)
    print(output)
    return 0


def _tell(event: Event) -> None:
    if isinstance(event, Warned):
        print(f"itmo-video: {event.message}", file=sys.stderr)
