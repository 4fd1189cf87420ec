"""Checking the structure of an EXR file without decoding: its header and chunk table."""

from __future__ import annotations

import struct

from itmo_video.compressions import CHUNK_LINES

_SAMPLE_BYTES = (4, 2, 4)  # by type: unsigned, half, float
_MOST_CHANNELS = 256
_PLAIN_FLAGS = 0x2 | 0x400  # version 2, scan lines in one part, perhaps with long names


class ExrDamageError(Exception):
    """Damage in a file; the message describes it."""


def parse_header(data: bytes, position: int = 8) -> tuple[dict[str, tuple[str, bytes]], int]:
    """The attributes of a part, as (type, value) by name, and the end of its header."""
    if data[:4] != b"\x76\x2f\x31\x01":
        raise ExrDamageError("empty" if not data else "not an EXR file")
    attributes: dict[str, tuple[str, bytes]] = {}
    try:
        while data[position] != 0:
            name_end = data.index(0, position)
            type_end = data.index(0, name_end + 1)
            start = type_end + 5
            (size,) = struct.unpack_from("<i", data, type_end + 1)
            if not 0 <= size <= len(data) - start:
                raise ExrDamageError("truncated in the header")
            name, kind = data[position:name_end], data[name_end + 1 : type_end]
            attributes[name.decode("latin-1")] = kind.decode("latin-1"), data[start : start + size]
            position = start + size
    except (IndexError, ValueError, struct.error) as error:
        raise ExrDamageError("truncated in the header") from error
    return attributes, position + 1


def with_window(data: bytes, width: int, height: int) -> bytes:
    """The bytes before a file's chunk table, with the windows resized, from (0, 0)."""
    attributes, _ = parse_header(data)
    window = "box2i", struct.pack("<4i", 0, 0, width - 1, height - 1)
    attributes |= {"dataWindow": window, "displayWindow": window}
    header = [data[:8]]
    for name, (kind, value) in attributes.items():
        header.append(f"{name}\0{kind}\0".encode("latin-1") + struct.pack("<i", len(value)) + value)
    return b"".join(header) + b"\0"


def check_chunks(data: bytes) -> None:
    """Check the chunk table of a plain scan line file: every chunk must lie within the file.

    Finds every file that is truncated or has holes in its table, without decoding; other kinds of
    EXR files pass unchecked.
    """
    attributes, table = parse_header(data)
    flags = struct.unpack_from("<I", data, 4)[0]
    try:
        method = attributes["compression"][1][0]
        left, top, right, bottom = struct.unpack("<4i", attributes["dataWindow"][1])
    except (KeyError, IndexError, struct.error) as error:
        raise ExrDamageError("the header is incomplete") from error
    lines = CHUNK_LINES.get(method, 0)
    if flags & ~_PLAIN_FLAGS or not lines:
        return
    count = -(-(bottom - top + 1) // lines)
    line_bytes = max(0, right - left + 1) * bytes_a_pixel(attributes)
    is_whole = b"\x01\0\0\0\x01\0\0\0" in attributes["channels"][1]  # not subsampled
    first = table + 8 * count
    if count < 1 or first > len(data):
        raise ExrDamageError("truncated")
    for index, offset in enumerate(struct.unpack_from(f"<{count}Q", data, table)):
        if not first <= offset <= len(data) - 8:
            raise ExrDamageError(f"truncated at line {index * lines}")
        y, size = struct.unpack_from("<ii", data, offset)
        if y != top + index * lines or not 0 < size <= len(data) - 8 - offset:
            raise ExrDamageError(f"truncated or damaged at line {index * lines}")
        # Data that compression does not shrink is stored raw; OpenEXR does not check raw chunks.
        plain = line_bytes * min(lines, bottom - top + 1 - index * lines)
        if size > plain or (method == 0 and size != plain and is_whole):
            raise ExrDamageError(f"damaged at line {index * lines}")


def bytes_a_pixel(attributes: dict[str, tuple[str, bytes]]) -> int:
    """The bytes per pixel over all channels; subsampled ones count fully."""
    _, value = attributes.get("channels", ("", b""))
    position = total = count = 0
    name = b""
    try:
        while value[position] != 0:
            end = value.index(0, position)
            name, before = value[position:end], name
            position = end + 1
            # The format requires rising order; DWA's decoder crashes otherwise.
            if name <= before or not name.isascii() or not name.decode().isprintable():
                raise ExrDamageError("its list of channels is damaged")
            kind, _, *sampling = struct.unpack_from("<4i", value, position)
            if not (0 <= kind < len(_SAMPLE_BYTES) and all(1 <= n <= 16 for n in sampling)):
                raise ExrDamageError("its list of channels is damaged")
            total += _SAMPLE_BYTES[kind]
            position, count = position + 16, count + 1
    except (IndexError, ValueError, struct.error) as error:
        raise ExrDamageError("its list of channels is damaged") from error
    if not 1 <= count <= _MOST_CHANNELS:
        raise ExrDamageError(f"it has {count} channels")
    return total
