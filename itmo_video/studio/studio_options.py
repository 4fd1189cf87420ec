"""The options specific to `studio`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from itmo_video.options import check_options, option

# The options of a run that the studio takes; its renders and its command have them, too.
OF_RUN = ("analysis", "start_number", "max_pixels")


@dataclass(frozen=True)
class StudioOptions:
    """Where the studio saves, and how its page is served. Validated on creation (UsageError)."""

    folder: Path = option(
        Path(), Path, "folder to save and render to (default: the current one)", metavar="DIR"
    )
    port: int = option(
        0, int, "port to serve the page on; 0 picks a free one", lower=0, upper=65535, metavar="N"
    )
    no_browser: bool = option(False, bool, "print the address instead of opening a browser")

    def __post_init__(self) -> None:
        check_options(self)
