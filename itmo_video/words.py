"""Wording of messages: counts, quotations and hints for installation."""

from __future__ import annotations


def counted(count: int, noun: str) -> str:
    """`1 frame`, `2 frames`; for nouns that take an s."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def cut(text: str, most: int = 300) -> str:
    """Foreign text shortened to `most` characters by leaving out its middle."""
    return text if len(text) <= most else f"{text[: most // 2]} ... {text[-most // 3 :]}"


def to_install(extra: str) -> str:
    """How to install an extra: from the source, as the package is not on an index."""
    return f"Run in the source folder of itmo_video: pip install '.[{extra}]'"


def frames_named(ranges: str) -> str:
    """`frame 5`, `frames 1-3`, of numbers as text."""
    return f"frame {ranges}" if ranges.isdecimal() else f"frames {ranges}"


def frames_are(ranges: str) -> str:
    """`frame 5 is`, `frames 1-3 are`, of numbers as text."""
    return f"{frames_named(ranges)} {'is' if ranges.isdecimal() else 'are'}"


def has_or_have(count: int) -> str:
    """The verb of one thing, or of several."""
    return "has" if count == 1 else "have"


def missing(count: int, noun: str) -> str:
    """`1 frame is missing`, `2 frames are missing`."""
    return f"{counted(count, noun)} {'is' if count == 1 else 'are'} missing"
