"""What a terminal is: its width, and whether it wants colour."""

from __future__ import annotations

import os
from typing import TextIO

PROGRAM = "itmo-video"
_COLOURS = {"red": "\x1b[1;31m", "yellow": "\x1b[33m"}


def has_colour(stream: TextIO) -> bool:
    """Whether to colour what is printed there: terminals, without NO_COLOR and TERM=dumb."""
    if os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb":
        return False
    return stream.isatty()


def named(message: object, stream: TextIO, colour: str) -> str:
    """A message with the program's name before it, which alone is coloured."""
    name = f"{PROGRAM}:"
    if has_colour(stream):
        name = f"{_COLOURS[colour]}{name}\x1b[0m"
    return f"{name} {message}"


def width_of(stream: TextIO) -> int:
    """Columns of the terminal; 80 where it does not say."""
    try:
        return os.get_terminal_size(stream.fileno()).columns or 80
    except (OSError, ValueError, AttributeError):
        return 80
