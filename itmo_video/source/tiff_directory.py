"""A TIFF's first directory: its entries, and a check of JPEG-compressed strips and tiles."""

from __future__ import annotations

import struct
from typing import NamedTuple

from itmo_video.source.damage import DamageError, check_jpeg

_COMPRESSION, _JPEG = 259, 7
_OFFSETS, _COUNTS = (273, 324), (279, 325)  # of strips, of tiles
_FORMS = {1: "B", 3: "H", 4: "I", 16: "Q"}
_MOST_ENTRIES, _MOST_PARTS = 1000, 1 << 22


class Entry(NamedTuple):
    """One entry: its type, the number of values, and the offset of the first."""

    kind: int
    length: int
    at: int


def first_directory(data: bytes) -> dict[int, Entry]:
    """Entries of the first directory (TIFF 6.0, section 2; BigTIFF) by tag; {} if broken."""
    order, is_big = _byte_order(data), _is_big(data)
    word = "Q" if is_big else "I"
    size = struct.calcsize(f"={word}")
    try:
        at = struct.unpack_from(f"{order}{word}", data, size)[0]
        count = struct.unpack_from(f"{order}{'Q' if is_big else 'H'}", data, at)[0]
        at += 8 if is_big else 2
        found = {}
        for _ in range(min(count, _MOST_ENTRIES)):
            tag, kind, number = struct.unpack_from(f"{order}HH{word}", data, at)
            value_at = at + 4 + size
            width = struct.calcsize(f"={_FORMS[kind]}") if kind in _FORMS else 0
            if width * number > size:
                value_at = struct.unpack_from(f"{order}{word}", data, value_at)[0]
            found[tag] = Entry(kind, number, value_at)
            at += 4 + 2 * size
        return found
    except struct.error:
        return {}


def numbers(data: bytes, entry: Entry | None) -> tuple[int, ...]:
    """The entry's integers; () if it has none, or they lie outside the file."""
    form = None if entry is None else _FORMS.get(entry.kind)
    if entry is None or form is None or entry.length > _MOST_PARTS:
        return ()
    try:
        return struct.unpack_from(f"{_byte_order(data)}{entry.length}{form}", data, entry.at)
    except struct.error:
        return ()


def check_jpeg_parts(data: bytes) -> None:
    """Raise DamageError unless each JPEG strip or tile is complete up to its end marker.

    libtiff silently shows what there is of one, and a plain colour for the rest. (It does report
    damage with other compressions.)
    """
    entries = first_directory(data)
    if numbers(data, entries.get(_COMPRESSION))[:1] != (_JPEG,):
        return
    for offsets, counts in zip(_OFFSETS, _COUNTS, strict=True):
        starts, sizes = numbers(data, entries.get(offsets)), numbers(data, entries.get(counts))
        for number, (at, size) in enumerate(zip(starts, sizes, strict=False), 1):
            if size:  # a part of 0 bytes was omitted, which libtiff reports
                _check_part(data[at : at + size], number)


def _check_part(data: bytes, number: int) -> None:
    try:
        check_jpeg(data)
    except DamageError as error:
        raise DamageError(f"strip or tile {number} is damaged") from error


def _byte_order(data: bytes) -> str:
    return "<" if data[:2] == b"II" else ">"


def _is_big(data: bytes) -> bool:
    return data[2:4] in (b"\x2b\0", b"\0\x2b")
