"""The flags of the settings, and the settings by preset and flags."""

from __future__ import annotations

import argparse

from itmo_video.cli.option_flags import add_options, given
from itmo_video.presets import make_settings
from itmo_video.settings import Settings


def add_settings(parser: argparse.ArgumentParser) -> None:
    """Add a flag for the preset and for each setting."""
    group = parser.add_argument_group(
        "settings (each may stand in a preset's TOML, too; in brackets what holds without either)"
    )
    group.add_argument(
        "--preset", default="default", metavar="NAME|FILE.toml",
        help="a named set of settings that flags override (default)",
    )  # fmt: skip
    defaults = vars(make_settings())
    add_options(group, Settings, defaults=defaults, negatable=True)


def settings_of(args: argparse.Namespace) -> Settings:
    """The settings by preset and flags; raises UsageError for what they do not allow."""
    return make_settings(args.preset, **given(args, Settings))
