"""Checks that a CineForm packet is complete, as FFmpeg's decoder silently skips unknown data.

If sizes or numbers of bands are damaged, it shows memory that was never written. The layout
is that of SMPTE ST 2073-1 (VC-5), with CineForm's own tags.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

_ORDER = [1, 2, 3] * 3  # of the highpass bands within their level; a lowpass band comes first
_TRAILER = b"\x00\x38\x00\x00"  # tag 56, after the codes of a band
_END_CODE, _END_BITS = 0x3114BA3, 26  # the last code of a band in codebook 18
_SKIPPED = range(0x4000, 0x4100)  # tags whose value counts words of private data
_COEFFICIENTS = 0x0F0F  # value of tag 4 ahead of the lowpass band
Size = tuple[int, int]  # width, height


class _StructureError(ValueError):
    """The packet is damaged, or another kind of CineForm."""


@dataclass
class _Channel:
    """A channel's tags in order: the latest sizes, and the bands so far."""

    lowpass: Size = (0, 0)
    level: Size = (0, 0)
    band: Size = (0, 0)
    number: int = 0
    order: list[int] = field(default_factory=list)
    levels: list[Size] = field(default_factory=list)
    bands: list[tuple[int, Size]] = field(default_factory=list)


def is_whole(packet: bytes) -> bool:
    """Whether all channels of an intra packet have all bands, with matching sizes."""
    try:
        channels = _channels(packet)
    except _StructureError:
        return False
    colours = [channel.bands for channel in channels[1:]]
    return (
        len(channels) in (3, 4)
        and all(bands == colours[0] for bands in colours[:2])
        and all(map(_is_pyramid, channels))
    )


def _is_pyramid(channel: _Channel) -> bool:
    """Whether the bands are those of three levels, each twice the size of the one before."""
    if [number for number, _ in channel.bands] != list(range(10)) or channel.order != _ORDER:
        return False
    sizes = [size for _, size in channel.bands]
    levels = [sizes[0:4], sizes[4:7], sizes[7:10]]
    doubles = all(
        2 * low - high in (0, 1)
        for small, large in pairwise(levels)
        for low, high in zip(small[0], large[0], strict=True)
    )
    return (
        doubles
        and all(level.count(level[0]) == len(level) for level in levels)
        and channel.levels == [level[0] for level in levels]
    )


def _channels(packet: bytes) -> list[_Channel]:
    """The channels, found by walking tags and values of 16 bits each; band codes are skipped."""
    channels, at, codebook = [_Channel()], 0, 0
    while at + 4 <= len(packet):
        tag = int.from_bytes(packet[at : at + 2], "big", signed=True)
        value = int.from_bytes(packet[at + 2 : at + 4], "big")
        here = channels[-1]
        at += 4
        if abs(tag) in _SKIPPED or tag == 2:  # tag 2: the table of channels
            at += 4 * value
        elif tag == 10 and value != 0:
            raise _StructureError("frames are coded in pairs")
        elif tag == 62:
            if value != len(channels):
                raise _StructureError("channels are not in order")
            channels.append(_Channel())
        elif tag == 27:
            here.lowpass = value, here.lowpass[1]
        elif tag == 28:
            here.lowpass = here.lowpass[0], value
        elif tag == 41:
            here.level = value, here.level[1]
        elif tag == 42:
            here.level = here.level[0], value
            here.levels.append(here.level)
        elif tag == 48 and value:
            here.order.append(value)
        elif tag == 49:
            here.band = value, here.band[1]
        elif tag == 50:
            here.band = here.band[0], value
        elif tag == 51:
            here.number = value
        elif tag == 72:
            codebook = value & 0xF
        elif tag == 4 and value == _COEFFICIENTS:
            here.bands.append((0, here.lowpass))
            at += -(-2 * here.lowpass[0] * here.lowpass[1] // 4) * 4
        elif tag == 55:
            here.bands.append((here.number, here.band))
            here.band = 0, 0
            at = _behind_codes(packet, at, codebook)
            codebook = 0
    if at > len(packet):
        raise _StructureError("truncated")
    return channels


def _behind_codes(packet: bytes, start: int, codebook: int) -> int:
    """The position of the trailer that follows the codes of a band."""
    at = packet.find(_TRAILER, start)
    while at >= 0:
        if (at - start) % 4 == 0 and (not codebook or _ends(packet[max(start, at - 8) : at])):
            return at
        at = packet.find(_TRAILER, at + 1)
    raise _StructureError("a band does not end")


def _ends(codes: bytes) -> bool:
    """Whether codes end with the last code of codebook 18, padded with zeros to 32 bits."""
    tail = int.from_bytes(codes, "big")
    if not tail:
        return False
    padding = (tail & -tail).bit_length() - 1  # the last code ends in a one
    return padding < 32 and (tail >> padding) & (1 << _END_BITS) - 1 == _END_CODE
