"""How the studio is opened: the options of `studio` that are its own."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from itmo_video.options import check_options, option


@dataclass(frozen=True)
class StudioOptions:
    """Where the studio saves, and how its page is reached. Validated when made (UsageError)."""

    folder: Path = option(
        Path(), Path, "folder to save and render to (the current one)", metavar="DIR"
    )
    port: int = option(
        0, int, "port of the page; 0 picks a free one", lower=0, upper=65535, metavar="N"
    )
    no_browser: bool = option(False, bool, "print the page's address, open no browser")

    def __post_init__(self) -> None:
        check_options(self)
