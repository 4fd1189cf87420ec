"""Inserts ITU-T T.35 messages into encoded HEVC and AV1 frames.

x265 and SVT-AV1 accept none through PyAV, so they are inserted into the encoder's packets.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Literal

_PREFIX_SEI, _FIRST_NOT_PICTURE = 39, 32  # types of HEVC's NAL units
_T35_SEI = 4
_FRAME_HEADER, _METADATA, _FRAME, _T35_METADATA = 3, 5, 6, 4  # types of AV1's OBUs and metadata


def with_message(packet: bytes, message: bytes, codec: Literal["hevc", "av1"]) -> bytes:
    """The packet of one shown frame, with the message before its picture.

    HEVC is a byte stream (annex B), AV1 a temporal unit of OBUs with sizes. ValueError if it
    contains no picture.
    """
    at = _hevc_picture(packet) if codec == "hevc" else _av1_picture(packet)
    unit = _sei(message) if codec == "hevc" else _metadata_obu(message)
    return packet[:at] + unit + packet[at:]


def _sei(message: bytes) -> bytes:
    """A prefix SEI message (H.265, 7.3.5), with escaped bytes (7.4.2)."""
    size = len(message)
    payload = bytes([_T35_SEI, *[255] * (size // 255), size % 255]) + message + b"\x80"
    escaped = re.sub(rb"\x00\x00(?=[\x00-\x03])", b"\x00\x00\x03", payload)
    return b"\x00\x00\x00\x01" + bytes([_PREFIX_SEI << 1, 1]) + escaped


def _hevc_picture(packet: bytes) -> int:
    """The position of the first slice's start code."""
    for found in re.finditer(rb"\x00?\x00\x00\x01(.)", packet, re.DOTALL):
        if found[1][0] >> 1 & 63 < _FIRST_NOT_PICTURE:
            return found.start()
    raise ValueError("an HEVC packet without a picture")


def _metadata_obu(message: bytes) -> bytes:
    """A metadata OBU (AV1, 5.8) with the trailing bit."""
    payload = bytes([_T35_METADATA]) + message + b"\x80"
    return bytes([_METADATA << 3 | 2]) + _leb128(len(payload)) + payload


def _av1_picture(packet: bytes) -> int:
    """The position of the shown frame: the last one, after those decoded ahead."""
    starts = [at for at, kind in _obus(packet) if kind in (_FRAME_HEADER, _FRAME)]
    if not starts:
        raise ValueError("an AV1 packet without a picture")
    return starts[-1]


def _obus(packet: bytes) -> Iterator[tuple[int, int]]:
    """The position and type of each OBU."""
    at = 0
    while at < len(packet):
        header = packet[at]
        size_at = at + (2 if header & 4 else 1)
        size, shift = 0, 0
        while True:
            byte = packet[size_at]
            size |= (byte & 127) << shift
            size_at, shift = size_at + 1, shift + 7
            if byte < 128:
                break
        yield at, header >> 3 & 15
        at = size_at + size


def _leb128(value: int) -> bytes:
    out = []
    while value > 127:
        out.append(value & 127 | 128)
        value >>= 7
    return bytes([*out, value])
