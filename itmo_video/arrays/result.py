"""A converted folder as HDR arrays by frame number."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from itmo_video.arrays.expand import Expanded
from itmo_video.conversion.frame_ranges import format_ranges
from itmo_video.options import checked_path
from itmo_video.output.converted import Converted, ConvertedShot, open_converted, rgb_of
from itmo_video.settings import Settings


class Result(Mapping[int, Expanded]):
    """A converted folder: a mapping from the numbers in its file names to its pictures.

    Pictures are read on access and not kept. `converted` has more: paths, times, the source.

    >>> from itmo_video import RunOptions, convert, open_result
    >>> _ = convert("clip.mkv", "out", run=RunOptions(start_number=101))
    >>> result = open_result("out")
    >>> [(number, hdr.index) for number, hdr in result.items()], result.size
    ([(101, 0), (102, 1), (103, 2)], (96, 64))
    """

    def __init__(self, converted: Converted) -> None:
        self.converted = converted

    def __repr__(self) -> str:
        numbers = format_ranges(self)
        absent = f", {self.absent} absent" if self.absent else ""
        return f"<Result {str(self.converted.path)!r}: frames {numbers}{absent}>"

    @property
    def settings(self) -> Settings:
        """The settings of frames outside shots with settings of their own."""
        return self.converted.settings

    @property
    def shots(self) -> Sequence[ConvertedShot]:
        """The shots that have settings of their own, by index."""
        return self.converted.shots

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in pixels."""
        return self.converted.size

    @property
    def absent(self) -> str | None:
        """The numbers of the source's frames that are not in the folder, as "3,5-9"; or None."""
        return self.converted.absent

    def __getitem__(self, number: int) -> Expanded:
        """The picture of this number; raises KeyError if absent, and as Converted.read."""
        if number not in self.converted.files:
            raise KeyError(f"frame {number} is not in the folder, which has {format_ranges(self)}")
        image = self.converted.read(number)
        planes = image.channels.items()
        layers = {name.removesuffix(".Y"): plane for name, plane in planes if "." in name}
        return Expanded(
            self.converted.index_of(number),
            np.dstack(rgb_of(image)),
            layers,
            self.converted.settings_of(number),
            image.channels.get("A"),
        )

    def __iter__(self) -> Iterator[int]:
        """The numbers, in ascending order."""
        return iter(self.converted.numbers)

    def __len__(self) -> int:
        return len(self.converted.files)


def open_result(folder: str | Path) -> Result:
    """Open a converted folder; raises InputError if it is not one or has no frame.

    >>> from itmo_video import convert, make_settings, open_result
    >>> _ = convert("clip.mkv", "out", make_settings("default", layers=["gain"]))
    >>> result = open_result("out")
    >>> list(result), result[2].rgb.shape, result[2].layers["gain"].dtype
    ([1, 2, 3], (64, 96, 3), dtype('float16'))
    >>> result.settings.white_nits
    203.0
    """
    return Result(open_converted(Path(checked_path(folder, "folder"))))
