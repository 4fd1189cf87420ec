"""The flags of the settings, made from the settings' own definitions, and what was said by them."""

from __future__ import annotations

import argparse
import dataclasses
from typing import Any

from itmo_video.errors import UsageError
from itmo_video.presets import make_settings
from itmo_video.settings import Settings, flag_name, spec_of


def add_settings(parser: argparse.ArgumentParser) -> None:
    """Add a flag for the preset and for each setting."""
    group = parser.add_argument_group("settings (each may stand in a preset's TOML, too)")
    group.add_argument(
        "--preset", default="default", metavar="NAME|FILE.toml",
        help="a named set of settings that flags override (default: default)",
    )  # fmt: skip
    for f in dataclasses.fields(Settings):
        spec = spec_of(f)
        flag = f"--{flag_name(f.name)}"
        common: dict[str, Any] = {"dest": f"set_{f.name}", "default": None}
        text = spec.help.replace("%", "%%")
        bounds = ""
        if spec.lower is not None and spec.upper is not None:
            bounds = f"; {spec.lower:g} to {spec.upper:g}"
        if f.name == "operator_params":
            flag, common["action"] = "--operator-param", "append"
        if spec.kind is bool:
            group.add_argument(flag, action=argparse.BooleanOptionalAction, help=text, **common)
            continue
        if isinstance(f.default, int | float | str) and not isinstance(f.default, bool):
            bounds += f" (without a preset: {f.default})"
        group.add_argument(
            flag,
            type=spec.kind if spec.kind in (int, float, str) else str,
            choices=spec.choices or None,
            metavar=spec.metavar,
            help=text + bounds,
            **common,
        )


def settings_of(args: argparse.Namespace) -> Settings:
    """The settings by preset and flags; raises UsageError for what they do not allow."""
    overrides: dict[str, Any] = {}
    for name, value in vars(args).items():
        if not name.startswith("set_") or value is None:
            continue
        key = name.removeprefix("set_")
        if key == "layers":
            value = tuple(part for part in value.split(",") if part)
        elif key == "operator_params":
            value = dict(named_number("operator-param", text) for text in value)
        overrides[key] = value
    return make_settings(args.preset, **overrides)


def named_number(flag: str, text: str) -> tuple[str, float]:
    """Name and value of NAME=VALUE, as `flag` was given it; raises UsageError for anything else."""
    name, _, value = text.partition("=")
    try:
        return name, float(value)
    except ValueError:
        raise UsageError(f"{flag}: {text!r} is not NAME=VALUE with a number") from None
