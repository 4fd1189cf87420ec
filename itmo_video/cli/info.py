"""The commands `info`, `presets` and `operators`."""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from itmo_video.cli.option_flags import add_options, options_of
from itmo_video.conversion.run_options import RunOptions
from itmo_video.errors import InputError, UsageError
from itmo_video.options import flag_name
from itmo_video.presets import load_preset, make_settings, preset_names, read_preset

if TYPE_CHECKING:
    from itmo_video.source.opening import Clip


def add_info(commands: Any) -> None:
    """Add the three subcommands."""
    info = commands.add_parser(
        "info",
        help="show a clip's metadata and the defaults that will be used",
        description="Show a clip's metadata, and what convert will assume where it has none.",
    )
    info.add_argument("input", metavar="INPUT", help="a clip, a still or an image sequence")
    add_options(info, RunOptions, ("max_pixels",))
    info.add_argument("--json", action="store_true", help="print JSON")
    info.set_defaults(run=_info)

    presets = commands.add_parser(
        "presets",
        help="list the presets and their settings",
        description="List the presets and their settings.",
    )
    presets.add_argument("--json", action="store_true", help="print JSON")
    presets.set_defaults(run=_presets)
    operators = commands.add_parser(
        "operators",
        help="list the operators with their parameters and sources",
        description="List the inverse tone mapping operators with their parameters and sources.",
    )
    operators.set_defaults(run=_operators)


def _info(args: argparse.Namespace) -> int:
    from itmo_video.output.manifest import MANIFEST_NAME
    from itmo_video.source import facts
    from itmo_video.source.opening import open_clip
    from itmo_video.source.pipe import is_pipe
    from itmo_video.source.tags import InputOptions

    if is_pipe(args.input):
        raise UsageError(
            "a pipe can be read only once, and info reads no frames of it",
            remedy="Give a file; `convert -` tells what it assumes of a pipe.",
        )
    if os.path.exists(os.path.join(args.input, MANIFEST_NAME)):
        raise InputError(
            "is a converted folder, not a clip",
            where=args.input,
            remedy="`report` shows it, `analyse --hdr10` its light levels, `evaluate` its figures; "
            "for metadata give a frame of it, or the clip that it was made from.",
        )
    # HDR that convert would refuse is only reported by info.
    options = InputOptions(only_tells=True, max_pixels=options_of(args, RunOptions).max_pixels)
    with open_clip(args.input, options) as clip:
        told = facts.clip_facts(clip.info)
        if (rendering := _rendering(clip)) is not None:
            told["rendering"] = rendering
    if args.json:
        print(json.dumps(told, indent=1))
    else:
        print(as_table(told))
    return 0


def _rendering(clip: Clip) -> dict[str, str] | None:
    """How the first frame was rendered to SDR; None for HDR, or if it cannot be decoded."""
    from itmo_video.errors import ItmoError
    from itmo_video.operators.auto_rendering import rendering_of_frame

    if clip.info.encoding.transfer in ("pq", "hlg", "log"):
        return None
    settings = make_settings()
    try:
        first = next(iter(clip.frames()), None)
    except ItmoError:  # convert reports it
        return None
    if first is None:
        return None
    words = rendering_of_frame(first, settings.map_width).in_words(settings.l_max_effective)
    whole = "the picture" if clip.info.frames == 1 else None
    return {"value": words, "from": whole or "the first frame alone; `analyse` shows each shot"}


def _presets(args: argparse.Namespace) -> int:
    if args.json:
        told = {
            name: {
                "description": read_preset(name).get("description", ""),
                "settings": {flag_name(key): value for key, value in load_preset(name).items()},
            }
            for name in preset_names()
        }
        print(json.dumps(told, indent=1))
        return 0
    for name in preset_names():
        content = read_preset(name)
        print(f"{name}: {content.get('description', '')}")
        for key, value in load_preset(name).items():
            print(f"    {flag_name(key)} = {json.dumps(value)}")
    return 0


def _operators(args: argparse.Namespace) -> int:
    from itmo_video.operators import all_operators

    for operator in all_operators().values():
        print(f"{operator.name}: {operator.summary}\n    {operator.source}")
        for name, p in operator.parameters.items():
            print(f"    {name} = {p.default:g} ({p.lower:g} to {p.upper:g}): {p.help}")
    return 0


def as_table(facts: Mapping[str, Any]) -> str:
    """The facts as aligned lines."""
    lines = []
    for name, value in facts.items():
        if isinstance(value, dict):
            value = f"{value['value']} ({value['from']})"
        if isinstance(value, list):
            value = ("\n" + 21 * " ").join(value)
        lines.append(f"{name.replace('_', ' '):20} {'-' if value is None else value}")
    return "\n".join(lines)
