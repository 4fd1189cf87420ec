"""Cropping a decoded picture's planes to the visible area stated by its container."""

from __future__ import annotations

from itmo_video.model import Code, Encoding
from itmo_video.source.planes import full_chroma

Crop = tuple[int, int, int, int]  # left, top, right, bottom: pixels to remove


def cropped_size(size: tuple[int, int], crop: Crop | None) -> tuple[int, int]:
    """(width, height) after cropping."""
    if crop is None:
        return size
    return size[0] - crop[0] - crop[2], size[1] - crop[1] - crop[3]


def usable(crop: Crop | None, size: tuple[int, int]) -> Crop | None:
    """The crop, None if it is empty or would leave nothing."""
    if crop is None or min(crop) < 0 or not any(crop):
        return None
    width, height = cropped_size(size, crop)
    return crop if width > 0 and height > 0 else None


def cropped(
    planes: tuple[Code, ...], encoding: Encoding, crop: Crop
) -> tuple[tuple[Code, ...], Encoding]:
    """The planes without the cropped rows and columns.

    Subsampled chroma that would be cut between two of its samples is upsampled to full size.
    """
    height, width = planes[0].shape
    if encoding.family == "ycbcr":
        across = -(-width // planes[1].shape[1])
        down = -(-height // planes[1].shape[0])
        if crop[0] % across or crop[1] % down:
            planes, encoding = full_chroma(planes, encoding)
    right, bottom = width - crop[2], height - crop[3]
    out: list[Code] = []
    for plane in planes:
        across, down = -(-width // plane.shape[1]), -(-height // plane.shape[0])
        rows = slice(crop[1] // down, -(-bottom // down))
        out.append(plane[rows, crop[0] // across : -(-right // across)])
    return tuple(out), encoding
