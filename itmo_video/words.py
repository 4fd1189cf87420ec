"""Counts in messages as people say them."""

from __future__ import annotations


def counted(count: int, noun: str) -> str:
    """`1 frame`, `2 frames`; for nouns that take an s."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def to_install(extra: str) -> str:
    """How to install an extra: from where the package itself came, which is no index."""
    return f"Install itmo_video[{extra}] from its source folder: pip install '.[{extra}]'"


def missing(count: int, noun: str) -> str:
    """`1 frame is missing`, `2 frames are missing`."""
    return f"{counted(count, noun)} {'is' if count == 1 else 'are'} missing"
