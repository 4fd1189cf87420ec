"""Counts the numbered frames of an ASF or WMV file, as FFmpeg silently skips damaged packets.

Advanced Systems Format specification, revision 01.20.03 (sections in brackets).
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import BinaryIO

from itmo_video.regular_file import open_regular

_HEADER = bytes.fromhex("3026b2758e66cf11a6d900aa0062ce6c")
_DATA = bytes.fromhex("3626b2758e66cf11a6d900aa0062ce6c")
_PROPERTIES = bytes.fromhex("a1dcab8c47a9cf118ee400c00c205365")
_MOST_HEADER_BYTES = 16 << 20
_LENGTH_BYTES = (0, 1, 2, 4)  # of a field, by its two-bit type


def numbered_frames(path: Path, stream: int) -> int:
    """The number of frames of the video stream with this number, including lost ones.

    A frame is lost if both numbers and times have a gap; files that were cut and joined have only
    one of them. 0 if none is lost, or if the file's structure is not understood.
    """
    try:
        seen = list(_frames(path, stream))
    except OSError:  # a disk that fails is reported where the packets are read
        return 0
    pairs = [(b[0] - a[0] & a[2], b[1] - a[1]) for a, b in pairwise(seen)]
    steps = sorted(ms for numbers, ms in pairs if numbers == 1 and ms > 0)
    if not steps:
        return 0
    step_ms = steps[len(steps) // 2]
    lost = sum(max(0, min(n, round(ms / step_ms)) - 1) for n, ms in pairs)
    return len(seen) + lost if lost else 0


def _frames(path: Path, stream: int) -> Iterator[tuple[int, int, int]]:
    """Number, presentation time in ms and highest number of each media object, in file order."""
    last = -1
    with open_regular(path) as file:
        packet_bytes = _packet_size(file)
        while packet_bytes and len(packet := file.read(packet_bytes)) == packet_bytes:
            try:
                for number, time_ms, largest in _objects(packet, stream):
                    if number != last:
                        yield number, time_ms, largest
                    last = number
            except IndexError:
                continue  # the content of this packet is unknown


def _packet_size(file: BinaryIO) -> int:
    """The size of data packets, with the file at the first one; 0 if sizes differ."""
    head = file.read(30)
    size = int.from_bytes(head[16:24], "little")
    if head[:16] != _HEADER or not 30 <= size <= _MOST_HEADER_BYTES:
        return 0
    body, at, packet_bytes = file.read(size - 30), 0, 0
    while at + 24 <= len(body):
        length = int.from_bytes(body[at + 16 : at + 24], "little")
        if body[at : at + 16] == _PROPERTIES:  # (3.2)
            least, most = (int.from_bytes(body[at + p : at + p + 4], "little") for p in (92, 96))
            packet_bytes = most if least == most else 0
        if length < 24:
            return 0
        at += length
    return packet_bytes if file.read(50)[:16] == _DATA else 0  # (5.1)


def _objects(packet: bytes, stream: int) -> Iterator[tuple[int, int, int]]:
    """The media objects of one stream of which a data packet (5.2) has parts."""
    at = 0

    def field(kind: int) -> int:
        nonlocal at
        size = _LENGTH_BYTES[kind & 3]
        if at + size > len(packet):
            raise IndexError
        at += size
        return int.from_bytes(packet[at - size : at], "little")

    if packet[0] & 0x80:  # error correction (5.2.1)
        at = 1 + (packet[0] & 0x0F)
    lengths, kinds = field(1), field(1)  # (5.2.2)
    for shift in (5, 1, 3):  # packet length, sequence, padding
        field(lengths >> shift)
    at += 6  # send time and duration
    payloads = field(1) if lengths & 1 else 0
    for _ in range(payloads & 0x3F if lengths & 1 else 1):
        owner = field(1) & 0x7F
        number = field(kinds >> 4)
        time_ms = field(kinds >> 2)  # of a compressed payload; else its place in the object
        replicated = field(kinds)
        if replicated >= 8:
            time_ms = int.from_bytes(packet[at + 4 : at + 8], "little")
        at += replicated
        if lengths & 1:
            length = field(payloads >> 6)
            at += length
        if owner == stream:
            yield number, time_ms, (1 << 8 * _LENGTH_BYTES[kinds >> 4 & 3]) - 1
