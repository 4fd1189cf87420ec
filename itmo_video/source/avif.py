"""AVIF stills: libavif (in Pillow) for grids, alpha and animations, FFmpeg for more than 8 bits."""

from __future__ import annotations

import io
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import av

from itmo_video.source import pillow_stills
from itmo_video.source.packets import decoder_limit
from itmo_video.source.planes import picture_of
from itmo_video.source.still_picture import StillPicture


def read_still(data: bytes, max_pixels: int, where: str) -> StillPicture:
    """An AVIF decoded by libavif, or by FFmpeg if it has more than 8 bits and a single tile.

    Pillow gives 8 bits of any AVIF; FFmpeg gives all bits, but only the first tile of a grid.
    """
    picture = pillow_stills.read_still(data, "avif", max_pixels, where)
    tags, frame = _first_item(data, max_pixels)
    picture = replace(picture, colour=replace(picture.colour, cicp=tags))
    bits = _avif_bits(data)
    if bits == 8:
        return picture
    if picture.has_alpha or frame is None or (frame.width, frame.height) != picture.size:
        return replace(picture, notices=(*picture.notices, f"{bits} bits are read as 8"))
    deep = picture_of(Path(where), frame)
    if tags is None:  # AV1 has no default; libavif and browsers assume BT.601
        tags = (2, 2, 6, 1)
    is_full = int(frame.color_range) == 2
    return replace(
        picture,
        form=str(frame.format.name),
        family=deep.family,
        bit_depth=deep.bit_depth,
        planes=deep.planes,
        colour=replace(picture.colour, cicp=(*tags[:3], int(is_full))),
    )


def _first_item(data: bytes, max_pixels: int) -> tuple[tuple[int, int, int, int] | None, Any]:
    """Code points and picture of the first item as decoded by FFmpeg, None if it cannot."""
    try:
        options = {"max_pixels": decoder_limit(max_pixels)}
        box: Any = av.open(io.BytesIO(data), format="mov", options=options)
        with box:
            stream: Any = box.streams.video[0]
            stream.codec_context.options = options
            frame: Any = next(box.decode(stream))
            numbers = (frame.color_primaries, frame.color_trc, frame.colorspace)
            primaries, transfer, matrix = (int(n) for n in numbers)
            return (primaries, transfer, matrix, int(int(frame.color_range) == 2)), frame
    except (av.FFmpegError, OSError, ValueError, IndexError, StopIteration):
        return None, None


def _avif_bits(data: bytes) -> int:
    at = data.find(b"av1C")  # AV1-ISOBMFF, 2.3.3: high_bitdepth, twelve_bit
    if at < 0 or len(data) < at + 7:
        return 8
    flags = data[at + 6]
    return 8 if not flags & 0x40 else 12 if flags & 0x20 else 10


def frame_times(data: bytes) -> tuple[tuple[Fraction, ...], Fraction]:
    """The start time of each frame of an animation's track, and the end of the last, in seconds."""
    try:
        box: Any = av.open(io.BytesIO(data), format="mov")
        with box:
            stream: Any = max(box.streams.video, key=lambda s: int(s.frames or 0))
            base = Fraction(stream.time_base or 1)
            found = sorted(
                (packet.pts, packet.duration or 0)
                for packet in box.demux(stream)
                if packet.pts is not None and packet.size
            )
    except (av.FFmpegError, OSError, ValueError, IndexError):
        return (), Fraction(0)
    if not found:
        return (), Fraction(0)
    first = found[0][0]
    return tuple((pts - first) * base for pts, _ in found), (sum(found[-1]) - first) * base
