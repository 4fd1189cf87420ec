"""Whether a packet of Flash Screen Video is whole: FFmpeg shows what a broken block leaves unset.

Screen Video, version 1: Adobe Flash Video File Format Specification 10.1, Annex E.4.3.
"""

from __future__ import annotations

import zlib

_PIXEL_BYTES = 3


def is_whole(packet: bytes) -> bool:
    """Whether blocks fill the packet, and each one that is not skipped has all of its pixels."""
    widths, heights = (_parts(int.from_bytes(packet[at : at + 2], "big")) for at in (0, 2))
    at = 4
    for height in heights:
        for width in widths:
            begin = at + 2
            at = begin + int.from_bytes(packet[at:begin], "big")
            if at > len(packet):
                return False
            if at > begin and not _has(packet[begin:at], _PIXEL_BYTES * width * height):
                return False
    return at == len(packet)


def _parts(word: int) -> list[int]:
    """The blocks' sizes along one side: 4 bits of the block's size, 12 of the picture's."""
    size, side = 16 * ((word >> 12) + 1), word & 0xFFF
    return [min(size, side - begin) for begin in range(0, side, size)]


def _has(block: bytes, expected: int) -> bool:
    """Whether a zlib stream is intact and holds that many bytes."""
    stream = zlib.decompressobj()
    try:
        return len(stream.decompress(block, expected + 1)) == expected and stream.eof
    except zlib.error:
        return False
