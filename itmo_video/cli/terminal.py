"""A terminal's width, and whether to use colour."""

from __future__ import annotations

import os
from typing import TextIO

PROGRAM = "itmo-video"
_COLOURS = {"red": "\x1b[1;31m", "yellow": "\x1b[33m"}


def has_colour(stream: TextIO) -> bool:
    """Whether to use colour: on terminals, without NO_COLOR or TERM=dumb."""
    if os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb":
        return False
    return stream.isatty()


def named(message: object, stream: TextIO, colour: str) -> str:
    """A message prefixed with the program's name, which alone is coloured."""
    name = f"{PROGRAM}:"
    if has_colour(stream):
        name = f"{_COLOURS[colour]}{name}\x1b[0m"
    return f"{name} {message}"


def width_of(stream: TextIO) -> int:
    """The terminal's columns; 80 if unknown."""
    try:
        return os.get_terminal_size(stream.fileno()).columns or 80
    except (OSError, ValueError, AttributeError):
        return 80
