"""The bytes of an EXR file followed without decoding: its header, its table of chunks."""

from __future__ import annotations

import struct

from itmo_video.compressions import CHUNK_LINES

_PLAIN_FLAGS = 0x2 | 0x400  # version 2, scan lines in one part, perhaps with long names


class DamageError(Exception):
    """Why a file cannot be whole."""


def parse_header(data: bytes, position: int = 8) -> tuple[dict[str, tuple[str, bytes]], int]:
    """Return (type, value) of a part's attributes by name, and where its header ends."""
    if data[:4] != b"\x76\x2f\x31\x01":
        raise DamageError("empty" if not data else "no EXR file at all")
    attributes: dict[str, tuple[str, bytes]] = {}
    try:
        while data[position] != 0:
            name_end = data.index(0, position)
            type_end = data.index(0, name_end + 1)
            start = type_end + 5
            (size,) = struct.unpack_from("<i", data, type_end + 1)
            if not 0 <= size <= len(data) - start:
                raise DamageError("cut short in its header")
            name, kind = data[position:name_end], data[name_end + 1 : type_end]
            attributes[name.decode("latin-1")] = kind.decode("latin-1"), data[start : start + size]
            position = start + size
    except (IndexError, ValueError, struct.error) as error:
        raise DamageError("cut short in its header") from error
    return attributes, position + 1


def with_window(data: bytes, width: int, height: int) -> bytes:
    """The bytes in front of a file's table of chunks, with windows of another size from (0, 0)."""
    attributes, _ = parse_header(data)
    window = "box2i", struct.pack("<4i", 0, 0, width - 1, height - 1)
    attributes |= {"dataWindow": window, "displayWindow": window}
    header = [data[:8]]
    for name, (kind, value) in attributes.items():
        header.append(f"{name}\0{kind}\0".encode("latin-1") + struct.pack("<i", len(value)) + value)
    return b"".join(header) + b"\0"


def check_chunks(data: bytes) -> None:
    """Follow the table of chunks through a plain scan line file: each must lie inside of it.

    Finds every file that was cut short or has holes in its table, quietly and without decoding;
    other kinds of EXR file pass unseen.
    """
    attributes, table = parse_header(data)
    flags = struct.unpack_from("<I", data, 4)[0]
    try:
        method = attributes["compression"][1][0]
        _, top, _, bottom = struct.unpack("<4i", attributes["dataWindow"][1])
    except (KeyError, IndexError, struct.error) as error:
        raise DamageError("its header is incomplete") from error
    lines = CHUNK_LINES.get(method, 0)
    if flags & ~_PLAIN_FLAGS or not lines:
        return
    count = -(-(bottom - top + 1) // lines)
    first = table + 8 * count
    if count < 1 or first > len(data):
        raise DamageError("cut short")
    for index, offset in enumerate(struct.unpack_from(f"<{count}Q", data, table)):
        if not first <= offset <= len(data) - 8:
            raise DamageError(f"cut short at line {index * lines}")
        y, size = struct.unpack_from("<ii", data, offset)
        if y != top + index * lines or not 0 < size <= len(data) - 8 - offset:
            raise DamageError(f"cut short or damaged at line {index * lines}")
