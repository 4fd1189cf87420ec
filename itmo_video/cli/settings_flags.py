"""The flags of the settings, and settings from preset and flags."""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Collection

from itmo_video.cli.config_file import preset_of, said
from itmo_video.cli.option_flags import add_options
from itmo_video.options import flag_of
from itmo_video.presets import make_settings
from itmo_video.settings import LOOK, Settings


def add_settings(parser: argparse.ArgumentParser, without: Collection[str] = ()) -> None:
    """Add a flag for the preset and for each setting but those in `without`, in two groups."""
    group = parser.add_argument_group(
        "the look (also keys in a preset's TOML; defaults in parentheses)"
    )
    group.add_argument(
        "--preset", default=None, metavar="NAME|FILE.toml",
        help="preset to start from; flags override it (default)",
    )  # fmt: skip
    group.add_argument("--no-config", action="store_true", help="ignore the user's config file")
    defaults = vars(make_settings())
    look = [name for name in LOOK if name not in without]
    files = [name for name in defaults if name not in (*LOOK, *without)]
    add_options(group, Settings, look, defaults, negatable=True)
    group = parser.add_argument_group("the clip and its files (also keys in a preset's TOML)")
    add_options(group, Settings, files, defaults, negatable=True)


def in_words(settings: Settings) -> str:
    """All settings in one line, by the names of their flags."""
    values = settings.as_dict()
    told = (
        f"{flag_of(f)}={values[f.name]}"
        for f in dataclasses.fields(Settings)
        if values[f.name] not in (None, [], {})
    )
    return f"settings: {', '.join(told)}"


def settings_of(args: argparse.Namespace) -> Settings:
    """The settings from preset, config and flags; raises UsageError for invalid ones."""
    return make_settings(preset_of(args), **said(args, Settings))
