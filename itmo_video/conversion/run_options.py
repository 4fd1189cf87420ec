"""The options of `convert` that do not change pixels, and its shot list."""

from __future__ import annotations

from dataclasses import dataclass

from itmo_video.analysis.model import Analysis
from itmo_video.analysis.reading import read_analysis
from itmo_video.options import check_options, option
from itmo_video.source.files import pixel_limit


@dataclass(frozen=True)
class RunOptions:
    """How a conversion is run; only `analysis` affects the frames' content.

    The shots of `analysis` give their frames their own look, or disable the expansion. Validated on
    creation; raises UsageError.

    >>> from itmo_video import RunOptions
    >>> RunOptions(frames="1-100", jobs=2).max_pixels
    134217728
    """

    frames: str | None = option(
        None, str, "only these frames, numbered as in file names: 1-100,200-300x2", metavar="RANGES"
    )
    start_number: int | None = option(
        None,
        int,
        "number of the first frame (default: 1; image sequences keep their own)",
        lower=0,
        metavar="N",
    )
    jobs: int | None = option(
        None, int, "worker threads (default: one per core)", lower=1, upper=4096, metavar="N"
    )
    overwrite: bool = option(
        False, bool, "overwrite existing output; re-render all frames of a folder"
    )
    update: bool = option(False, bool, "re-render frames whose settings have changed")
    durable: bool = option(False, bool, "wait until each file is on the disk (fsync)")
    null: bool = option(False, bool, "render everything, write nothing")
    max_pixels: int = pixel_limit()
    analysis: Analysis | None = option(
        None, Analysis, "shot list written by `analyse`, edited or not",
        metavar="FILE.json", read=read_analysis,
    )  # fmt: skip

    def __post_init__(self) -> None:
        check_options(self)
