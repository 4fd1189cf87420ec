"""A parser's commands and flags, read from argparse, for completion and the manual page."""

from __future__ import annotations

import argparse
from dataclasses import dataclass

from itmo_video.cli.parser import metavar_of, usage_of
from itmo_video.operators import OPERATORS
from itmo_video.presets import preset_names

_HIDDEN = (argparse.SUPPRESS, None)


@dataclass(frozen=True)
class Flag:
    """A flag: its names, help, the name of its value ("" for a switch), and known values."""

    names: tuple[str, ...]
    help: str
    metavar: str
    values: tuple[str, ...]


@dataclass(frozen=True)
class Command:
    """A subcommand: its usage without its name, its arguments with their help, and its flags."""

    name: str
    help: str
    description: str
    usage: str
    arguments: tuple[tuple[str, str], ...]
    flags: tuple[Flag, ...]


def commands_of(parser: argparse.ArgumentParser) -> list[Command]:
    """The subcommands of a parser, in order."""
    found: list[Command] = []
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            helps = {choice.dest: choice.help or "" for choice in action._choices_actions}
            found += [
                _command(name, helps.get(name, ""), sub) for name, sub in action.choices.items()
            ]
    return found


def flags_of(parser: argparse.ArgumentParser) -> tuple[Flag, ...]:
    """A parser's flags, in order."""
    return tuple(
        _flag(parser, action)
        for action in parser._actions
        if action.option_strings and action.help not in _HIDDEN
    )


def _command(name: str, text: str, parser: argparse.ArgumentParser) -> Command:
    arguments = tuple(
        (metavar_of(action), _expanded(parser, action))
        for action in parser._actions
        if not action.option_strings and action.help not in _HIDDEN
    )
    text = text.replace("%%", "%")
    description = parser.description or text
    return Command(name, text, description, usage_of(parser), arguments, flags_of(parser))


def _flag(parser: argparse.ArgumentParser, action: argparse.Action) -> Flag:
    is_switch = action.nargs == 0
    values = tuple(str(choice) for choice in action.choices or ())
    names = tuple(action.option_strings)
    if "--operator" in names:
        values = tuple(OPERATORS)
    if "--preset" in names:
        values = tuple(preset_names())
    return Flag(names, _expanded(parser, action), "" if is_switch else metavar_of(action), values)


def _expanded(parser: argparse.ArgumentParser, action: argparse.Action) -> str:
    return parser._get_formatter()._expand_help(action) if action.help else ""
