"""How the studio is opened: the options of `studio` that are its own."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from itmo_video.options import check_options, option


@dataclass(frozen=True)
class StudioOptions:
    """Where the studio saves, and how its page is reached. Validated when made (UsageError)."""

    folder: Path = option(
        Path(), Path, "where files are saved and rendered to (this folder)", metavar="DIR"
    )
    port: int = option(
        0, int, "port of the page, a free one for 0", lower=0, upper=65535, metavar="N"
    )
    no_browser: bool = option(False, bool, "only print the page's address")

    def __post_init__(self) -> None:
        check_options(self)
