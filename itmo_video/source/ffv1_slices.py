"""Checksums of FFV1's slices, whose errors the decoder logs and otherwise ignores."""

from __future__ import annotations

import zlib
from collections.abc import Callable

_FOOTER_BYTES = 8  # slice_size (24 bits), error_status, slice_crc_parity (RFC 9043, 4.9)
_STARTS = (0, 0x7A8C4079)  # initial CRC: of version 3, and of ec 2 in FFmpeg's version 4
_MIRRORED = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))


def has_sums(packet: bytes) -> bool:
    """Whether a slice of a packet has a checksum that is right."""
    return any(_remainder(part) == 0 for part in slices_of(packet) or ())


def packet_check(seen: bool = False) -> Callable[[bytes], bool]:
    """A function that checks one packet of a stream after another.

    Streams without checksums pass. Once a packet had checksums (`seen`: an earlier one had), a
    later packet whose slices do not add up to its size fails.
    """

    def is_sound(packet: bytes) -> bool:
        nonlocal seen
        slices = slices_of(packet)
        if slices is None:
            return not seen
        sums = [_remainder(part) for part in slices]
        seen = seen or 0 in sums
        return not seen or not any(sums)

    return is_sound


def slices_of(packet: bytes) -> list[bytes] | None:
    """The slices of a packet, last first, by their footers; None if they do not add up."""
    found, end = [], len(packet)
    while end > 0:
        size = int.from_bytes(packet[max(0, end - _FOOTER_BYTES) : end][:3], "big") + _FOOTER_BYTES
        if size > end:
            return None
        found.append(packet[end - size : end])
        end -= size
    return found or None


def _remainder(part: bytes) -> int:
    """The CRC-32 over a slice including its checksum, 0 if it is intact (RFC 9043, 4.9.3).

    FFV1's CRC is most significant bit first, zlib's least: so the bits of bytes are reversed first.
    """
    mirrored = part.translate(_MIRRORED)
    return min(_sum_from(start, mirrored) for start in _STARTS)


def _sum_from(start: int, mirrored: bytes) -> int:
    begin = int(f"{start:032b}"[::-1], 2)
    return zlib.crc32(mirrored, begin ^ 0xFFFFFFFF) ^ 0xFFFFFFFF
