"""The values passed between stages: a clip's metadata, and one decoded frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt

Float32: TypeAlias = npt.NDArray[np.float32]
Float64: TypeAlias = npt.NDArray[np.float64]
Half: TypeAlias = npt.NDArray[np.float16]
Code: TypeAlias = npt.NDArray[np.uint8] | npt.NDArray[np.uint16]

Family = Literal["ycbcr", "rgb", "grey"]
Matrix = Literal["bt709", "bt601", "bt2020"]
Range = Literal["limited", "full"]
Transfer = Literal["bt1886", "srgb", "gamma22", "linear", "pq", "hlg", "log"]
Primaries = Literal["rec709", "rec601_525", "rec601_625", "rec2020", "p3d65", "adobergb"]
ChromaSiting = Literal[
    "left", "center", "topleft", "top", "right", "topright", "bottomleft", "bottom", "bottomright"
]
Origin = Literal["tag", "assumed", "set"]

# Frame rates of what states none: of a stream FFmpeg's own, by which it stamps frames.
ASSUMED_STREAM_RATE = Fraction(25)
ASSUMED_SEQUENCE_RATE = Fraction(24)  # of images in a folder, converted ones among them


@dataclass(frozen=True)
class Encoding:
    """How a frame's integer codes represent colour.

    `origins` states for "matrix", "range", "transfer", "primaries" and (of 4:2:0) "siting" whether
    the value comes from the file's tags, is assumed, or was set by the user.

    >>> from itmo_video import open_clip
    >>> with open_clip("photo.png") as clip:
    ...     encoding = clip.info.encoding
    >>> encoding.family, encoding.transfer, encoding.origins["transfer"]
    ('rgb', 'srgb', 'assumed')
    """

    family: Family
    bit_depth: int
    matrix: Matrix
    range: Range
    transfer: Transfer
    primaries: Primaries
    siting: ChromaSiting = "left"
    has_alpha: bool = False
    origins: Mapping[str, Origin] = field(default_factory=dict)

    @property
    def black_and_span(self) -> tuple[float, float]:
        """The code of black, and the number of codes from there to white, of luma, grey or RGB."""
        if self.range == "limited" and self.family != "rgb":
            step = 2.0 ** (self.bit_depth - 8)
            return 16 * step, 219 * step
        return 0.0, 2.0**self.bit_depth - 1


@dataclass(frozen=True)
class ClipInfo:
    """A clip's metadata, and the assumptions made about it.

    Sizes are in pixels as stored, before `rotation_deg` (clockwise, to be applied for display) and
    `flip` (mirrored left-right, applied before the rotation); `frames` counts what is presented.
    `frames_declared` is the container's frame count: more than `frames` where it is truncated
    or has lost some.

    >>> from itmo_video import open_clip
    >>> with open_clip("clip.mkv") as clip:
    ...     clip.info.frames, clip.info.display_size, str(clip.info.frame_rate)
    (3, (96, 64), '24')
    """

    path: str
    stem: str
    container: str
    codec: str
    pixel_format: str
    width: int
    height: int
    frames: int
    frame_rate: Fraction
    duration_s: Fraction
    is_vfr: bool
    pixel_aspect: Fraction
    rotation_deg: int
    flip: bool
    field_order: str
    timecode: str | None
    encoding: Encoding
    digest: str
    first_number: int | None = None
    notices: tuple[str, ...] = ()
    frames_declared: int | None = None

    @property
    def frames_cut_off(self) -> int:
        """How many frames fewer there are than the container states."""
        return max(0, (self.frames_declared or 0) - self.frames)

    @property
    def display_size(self) -> tuple[int, int]:
        """(width, height) in pixels after the rotation."""
        turned = self.rotation_deg % 180 != 0
        return (self.height, self.width) if turned else (self.width, self.height)


@dataclass(frozen=True)
class Frame:
    """One decoded frame, still as integer codes.

    `planes` holds, by `encoding.family`: (Y, Cb, Cr), (R, G, B) or (Y,), then A when it has alpha;
    uint8 for 8 bits, else uint16 with the code in the low bits; 4:2:0 and 4:2:2 chroma planes are
    smaller. They are read-only, and their lines may have gaps. `index` counts the source's frames
    in presentation order from 0; `time_s` is its presentation time in seconds, as stored in the
    file.

    >>> from itmo_video import open_clip
    >>> with open_clip("photo.png") as clip:
    ...     frame = next(clip.frames())
    >>> [plane.shape for plane in frame.planes], frame.size
    ([(64, 96), (64, 96), (64, 96)], (96, 64))
    """

    index: int
    time_s: Fraction
    planes: tuple[Code, ...]
    encoding: Encoding
    is_damaged: bool = False

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in pixels."""
        height, width = self.planes[0].shape
        return width, height
