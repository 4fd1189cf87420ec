"""Two JPEGs in one file: CIPA DC-007's Multi-Picture Format, XMP and ISO 21496-1 segments."""

from __future__ import annotations

import struct

_APP1, _APP2 = 0xE1, 0xE2
_XMP = b"http://ns.adobe.com/xap/1.0/\0"
_ISO = b"urn:iso:std:iso:ts:21496:-1\0"
_MPF = b"MPF\0"
_ISO_VERSION = struct.pack(">2H", 0, 0)  # in the first picture: minimum and writer version only
_MPF_BYTES = 4 + 8 + 2 + 3 * 12 + 4 + 2 * 16  # mark, header, one directory of three, two entries
_PRIMARY = 0x030000  # a baseline primary picture


def xmp_packet(attributes: str, inside: str = "") -> bytes:
    """An XMP packet with one description that has these attributes."""
    return (
        '<x:xmpmeta xmlns:x="adobe:ns:meta/" x:xmptk="itmo_video">'
        '<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">'
        f'<rdf:Description rdf:about="" {attributes}>{inside}</rdf:Description>'
        "</rdf:RDF></x:xmpmeta>"
    ).encode()


def joined(base: bytes, gain_map: bytes, map_xmp: bytes, map_iso: bytes) -> bytes:
    """The base JPEG followed by its gain map, which all three segments refer to."""
    second = _with_segments(
        gain_map, _segment(_APP1, _XMP + map_xmp) + _segment(_APP2, _ISO + map_iso)
    )
    told = _segment(_APP1, _XMP + _directory(len(second)))
    told += _segment(_APP2, _ISO + _ISO_VERSION)
    mpf_bytes = 4 + _MPF_BYTES
    first_bytes = len(base) + len(told) + mpf_bytes
    # Offsets count from the directory's header, after marker, length and identifier.
    header_at = _head_bytes(base) + len(told) + 4 + len(_MPF)
    mpf = _mpf(first_bytes, len(second), first_bytes - header_at)
    first = _with_segments(base, told + _segment(_APP2, _MPF + mpf))
    assert len(first) == first_bytes
    return first + second


def _directory(map_bytes: int) -> bytes:
    """The base's XMP: Google's container directory, which lists the gain map."""
    item = '<rdf:li rdf:parseType="Resource"><Container:Item Item:Mime="image/jpeg" {}/></rdf:li>'
    items = item.format('Item:Semantic="Primary"') + item.format(
        f'Item:Semantic="GainMap" Item:Length="{map_bytes}"'
    )
    return xmp_packet(
        'xmlns:Container="http://ns.google.com/photos/1.0/container/" '
        'xmlns:Item="http://ns.google.com/photos/1.0/container/item/" '
        'xmlns:hdrgm="http://ns.adobe.com/hdr-gain-map/1.0/" hdrgm:Version="1.0"',
        f"<Container:Directory><rdf:Seq>{items}</rdf:Seq></Container:Directory>",
    )


def _mpf(first_bytes: int, second_bytes: int, second_at: int) -> bytes:
    """The directory of two pictures, big endian (CIPA DC-007, 5.2)."""
    entries_at = 8 + 2 + 3 * 12 + 4
    fields = (
        struct.pack(">2HI4s", 0xB000, 7, 4, b"0100")
        + struct.pack(">2H2I", 0xB001, 4, 1, 2)
        + struct.pack(">2H2I", 0xB002, 7, 2 * 16, entries_at)
    )
    entries = struct.pack(">3I2H", _PRIMARY, first_bytes, 0, 0, 0)
    entries += struct.pack(">3I2H", 0, second_bytes, second_at, 0, 0)
    return b"MM\0*" + struct.pack(">IH", 8, 3) + fields + struct.pack(">I", 0) + entries


def _segment(marker: int, payload: bytes) -> bytes:
    return struct.pack(">BBH", 0xFF, marker, len(payload) + 2) + payload


def _head_bytes(jpeg: bytes) -> int:
    """The position to insert segments at: after SOI and JFIF's APP0."""
    if jpeg[2:4] == b"\xff\xe0":
        return 4 + int.from_bytes(jpeg[4:6], "big")
    return 2


def _with_segments(jpeg: bytes, segments: bytes) -> bytes:
    at = _head_bytes(jpeg)
    return jpeg[:at] + segments + jpeg[at:]
