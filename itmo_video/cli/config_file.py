"""The user's config file: defaults for when neither a flag nor a preset is given.

$XDG_CONFIG_HOME/itmo-video/config.toml, with `preset = NAME` and tables of flags without dashes:
[settings] as in a preset, [run] and [preview]. Frames depend on the effective settings, which the
folder's manifest records, wherever these come from.
"""

from __future__ import annotations

import argparse
import dataclasses
import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from itmo_video.cli.option_flags import given
from itmo_video.conversion.run_options import RunOptions
from itmo_video.delivery.preview_options import OF_ENCODING, PreviewOptions
from itmo_video.errors import InputError, UsageError
from itmo_video.options import flag_of, options_from, spec_of
from itmo_video.presets import load_preset, overriding
from itmo_video.settings import Settings
from itmo_video.untrusted import read_toml

# Nothing that replaces files or selects frames, which must be requested each time.
_TABLES: dict[str, tuple[type[Any], tuple[str, ...] | None]] = {
    "settings": (Settings, None),
    "run": (RunOptions, ("jobs", "durable", "max_pixels")),
    "preview": (
        PreviewOptions,
        ("view", "tone_map", "layout", "wipe_at", "no_labels", "scale", *OF_ENCODING),
    ),
}


@dataclass(frozen=True)
class Config:
    """A config file's values by field name, for each kind of options; empty if there is none.

    `notice` says why an existing file is ignored.
    """

    path: Path | None = None
    preset: str | None = None
    values: Mapping[type[Any], Mapping[str, Any]] = field(default_factory=dict)
    notice: str | None = None

    def of(self, kind: type[Any]) -> Mapping[str, Any]:
        """The values for options of this kind."""
        return self.values.get(kind, {})


def config_path() -> Path | None:
    """The path of the config file; None without a home folder."""
    base = os.environ.get("XDG_CONFIG_HOME", "")
    if not os.path.isabs(base):  # relative paths must be ignored by the specification
        base = os.environ.get("APPDATA", "") if os.name == "nt" else ""
    try:
        folder = Path(base) if base else Path.home() / ".config"
    except RuntimeError:
        return None
    return folder / "itmo-video" / "config.toml"


def read_config(path: Path) -> Config:
    """Read a config file; raises UsageError, naming it, for invalid content."""
    try:
        content = read_toml(path)
    except InputError as error:
        if isinstance(error.__cause__, FileNotFoundError | NotADirectoryError):
            return Config()
        if isinstance(error.__cause__, PermissionError):
            # Services may run with another user's HOME, which must not stop them.
            return Config(notice=f"{path}: permission denied; config file ignored")
        raise _wrong(error.what, path) from error
    if unknown := sorted(set(content) - {"preset", *_TABLES}):
        raise _wrong(f"unknown entry {', '.join(unknown)}", path)
    preset = content.get("preset")
    if preset is not None and not isinstance(preset, str):
        raise _wrong("preset must be text", path)
    try:
        if preset is not None:
            load_preset(preset)
        values = {
            kind: _checked(content.get(table, {}), table, kind, only)
            for table, (kind, only) in _TABLES.items()
        }
    except UsageError as error:
        raise _wrong(error.what, path, error.remedy) from error
    return Config(path, preset, values)


def config_of(args: argparse.Namespace) -> Config:
    """The user's config, unless --no-config is given; read once per command."""
    if not hasattr(args, "config"):
        path = None if args.no_config else config_path()
        args.config = Config() if path is None else read_config(path)
    assert isinstance(args.config, Config)
    return args.config


def preset_of(args: argparse.Namespace) -> str:
    """The preset to use: the flag's, the config's, or `default`."""
    return args.preset or config_of(args).preset or "default"


def said(args: argparse.Namespace, kind: type[Any]) -> dict[str, Any]:
    """The options of `kind` from config and flags; flags take precedence.

    The config's settings belong to its preset: with --preset they are ignored.
    """
    flags = given(args, kind)
    if kind is Settings and args.preset is not None:
        return flags
    return overriding(config_of(args).of(kind), flags)


def options_said(args: argparse.Namespace, kind: type[Any]) -> Any:
    """The options of `kind` from config and flags; raises UsageError for invalid ones."""
    return options_from(kind, said(args, kind))


def tell_config(args: argparse.Namespace, *kinds: type[Any]) -> None:
    """Report on standard error which defaults come from the config file, unless --quiet."""
    config = config_of(args)
    told: list[str] = []
    for kind in kinds:
        held, flags = said(args, kind), given(args, kind)
        names = {f.name: flag_of(f) for f in dataclasses.fields(kind)}
        told += [
            f"{names[n]} {v}" for n, v in config.of(kind).items() if n in held and n not in flags
        ]
    if Settings in kinds and config.preset is not None and args.preset is None:
        told.insert(0, f"preset {config.preset}")
    if config.notice is not None:
        message = config.notice
    elif told:
        message = f"from {config.path}: {', '.join(told)} (--no-config ignores it)"
    else:
        return
    if getattr(args, "log_file", None) is not None:
        args.log_file.write(message)
    if not getattr(args, "quiet", False):
        print(f"itmo-video: {message}", file=sys.stderr)


def _checked(
    table: object, name: str, kind: type[Any], only: tuple[str, ...] | None
) -> dict[str, Any]:
    if not isinstance(table, dict):
        raise UsageError(f"[{name}] must be a table")
    known = {flag_of(f): f for f in dataclasses.fields(kind) if only is None or f.name in only}
    values: dict[str, Any] = {}
    for key, value in table.items():
        flag = key.replace("_", "-")
        if flag not in known:
            raise UsageError(f"[{name}] has no {key}", remedy=f"Known: {', '.join(sorted(known))}")
        values[known[flag].name] = spec_of(known[flag]).check(flag, value)
    return overriding({}, values)


def _wrong(what: str, path: Path, remedy: str | None = None) -> UsageError:
    return UsageError(
        f"config file: {what}", where=str(path),
        remedy=remedy or "Correct it, or use --no-config.",
    )  # fmt: skip
