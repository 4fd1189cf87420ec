"""Counts in messages as people say them."""

from __future__ import annotations


def counted(count: int, noun: str) -> str:
    """`1 frame`, `2 frames`; for nouns that take an s."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def cut(text: str, most: int = 300) -> str:
    """Text that quotes what others wrote, of `most` characters: its middle is left out."""
    return text if len(text) <= most else f"{text[: most // 2]} ... {text[-most // 3 :]}"


def to_install(extra: str) -> str:
    """How to install an extra: from where the package itself came, which is no index."""
    return f"Install itmo_video[{extra}] from its source folder: pip install '.[{extra}]'"


def frames_are(ranges: str) -> str:
    """`frame 5 is`, `frames 1-3 are`, of numbers as text."""
    return f"frame {ranges} is" if ranges.isdecimal() else f"frames {ranges} are"


def missing(count: int, noun: str) -> str:
    """`1 frame is missing`, `2 frames are missing`."""
    return f"{counted(count, noun)} {'is' if count == 1 else 'are'} missing"
