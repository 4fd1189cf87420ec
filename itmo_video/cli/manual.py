"""`manual`: the manual page, generated from the definitions of all options."""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from itmo_video.cli.parser_facts import Command, Flag

EXIT_CODES = (
    ("0", "done"),
    ("1", "unexpected: a bug in itmo-video; also no memory left, or a lost cluster"),
    ("2", "wrong usage or settings"),
    ("3", "the input cannot be read, or is not a video"),
    ("4", "the input is damaged or truncated; everything else was converted"),
    ("5", "the output cannot be written"),
    ("6", "refused: the input is already HDR"),
    ("7", "a check failed"),
    ("130, 143", "interrupted; finished frames are intact, run the same command to resume"),
)


def add_manual(commands: Any, parser: argparse.ArgumentParser) -> None:
    """Add the subcommand, which describes all of `parser`."""
    manual = commands.add_parser(
        "manual",
        help="print the manual page (itmo-video manual | man -l -)",
        description="Print the manual page in roff, generated from the definitions of all options.",
    )

    def run(args: argparse.Namespace) -> int:
        from itmo_video.cli.parser_facts import commands_of

        print(manual_page(commands_of(parser)), end="")
        return 0

    manual.set_defaults(run=run)


def manual_page(commands: Sequence[Command]) -> str:
    """The page in roff's man macros; without a date, to be reproducible."""
    lines = [
        '.TH ITMO\\-VIDEO 1 "" "itmo_video" "User Commands"',
        ".SH NAME",
        "itmo\\-video \\- convert SDR video to HDR",
        ".SH SYNOPSIS",
        ".B itmo\\-video",
        "COMMAND [OPTION]... [ARGUMENT]...",
        ".SH COMMANDS",
    ]
    for command in commands:
        lines += [".TP", f".B {_roff(command.name)}", _roff(command.help)]
    for command in commands:
        lines += [
            f".SH {_roff(command.name.upper())}",
            f".B itmo\\-video {_roff(command.name)}",
            _roff(command.usage),
            ".PP",
            _roff(command.description),
        ]
        for name, text in command.arguments:
            lines += [".TP", f".I {_roff(name)}", _roff(text)]
        for flag in command.flags:
            lines += [".TP", _names(flag), _roff(flag.help)]
    lines.append(".SH EXIT STATUS")
    for code, text in EXIT_CODES:
        lines += [".TP", f".B {code}", _roff(text)]
    return "\n".join(lines) + "\n"


def _names(flag: Flag) -> str:
    names = ", ".join(f"\\fB{_roff(name)}\\fR" for name in flag.names)
    return f"{names} \\fI{_roff(flag.metavar)}\\fR" if flag.metavar else names


def _roff(text: str) -> str:
    text = re.sub(r"\s+", " ", text).strip().replace("\\", "\\e").replace("-", "\\-")
    return "\\&" + text if text.startswith((".", "'")) else text
