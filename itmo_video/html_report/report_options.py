"""The options of `report`: its output and the source to compare with."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from itmo_video.options import check_options, option
from itmo_video.source.files import pixel_limit


@dataclass(frozen=True)
class ReportOptions:
    """Where a report is written, and the source to compare with.

    Validated on creation; raises UsageError.

    >>> from pathlib import Path
    >>> from itmo_video import ReportOptions
    >>> ReportOptions(output=Path("page.html")).output.name
    'page.html'
    """

    output: Path | None = option(
        None, Path, "file to write (default: OUTPUT_DIR/report.html)", metavar="FILE.html"
    )
    clip: Path | None = option(
        None, Path, "the source clip, for before and after", flag="source", metavar="CLIP"
    )
    overwrite: bool = option(False, bool, "replace FILE.html")
    max_pixels: int = pixel_limit()

    def __post_init__(self) -> None:
        check_options(self)
