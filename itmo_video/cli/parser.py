"""The argument parser: help that fits the terminal, and errors that name what may be meant."""

from __future__ import annotations

import argparse
from difflib import get_close_matches
from typing import Any, NoReturn

from itmo_video.errors import UsageError


class Parser(argparse.ArgumentParser):
    """A parser whose usage is one line, and whose errors are UsageError."""

    def __init__(self, **given: Any) -> None:
        super().__init__(formatter_class=_Help, **given)
        self._positionals.title = "arguments"

    def format_help(self) -> str:
        """The help; with forty settings in it, argparse's own usage would fill a screen."""
        if self._subparsers is None:
            self.usage = f"%(prog)s {usage_of(self)}"
        return super().format_help()

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse; raises UsageError for flags that do not exist."""
        found, unknown = super().parse_known_args(args, namespace)
        if unknown and not any(word.startswith("-") for word in unknown):
            raise UsageError(
                f"too many arguments, from {unknown[0]} on",
                remedy="Give an image sequence by its pattern, such as img.%04d.png. "
                f"Usage: {self.prog} {usage_of(self)}",
            )
        if unknown:  # raised here, as the command itself knows what may have been meant
            flags = (word.partition("=")[0].replace("_", "-") for word in unknown)
            meant = next((m for f in flags for m in self._close_options(f)), None)
            see = f"See `{self.prog} --help`."
            raise UsageError(
                f"unrecognized arguments: {' '.join(unknown)}",
                remedy=f"Did you mean {meant}? {see}" if meant else see,
            )
        return found, unknown

    def _close_options(self, flag: str) -> list[str]:
        return get_close_matches(flag, self._option_string_actions, n=1, cutoff=0.75)

    def error(self, message: str) -> NoReturn:
        """Raise UsageError, in place of printing and exiting."""
        raise UsageError(message, remedy=f"See `{self.prog} --help`.")


class _Help(argparse.RawDescriptionHelpFormatter):
    """Descriptions are wrapped, examples are kept line by line."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        kind = argparse.RawDescriptionHelpFormatter if "\n" in text else argparse.HelpFormatter
        return kind._fill_text(self, text, width, indent)


def usage_of(parser: argparse.ArgumentParser) -> str:
    """What follows a command's name: [OPTION]... and its arguments."""
    arguments = (
        metavar_of(action) + "..." * (action.nargs == "+")
        for action in parser._actions
        if not action.option_strings
    )
    return " ".join(("[OPTION]...", *arguments))


def metavar_of(action: argparse.Action) -> str:
    """The name of an argument's or a flag's value: its metavar, or the values it may have."""
    if isinstance(action.metavar, str):
        return action.metavar
    return "|".join(map(str, action.choices)) if action.choices else action.dest.upper()
