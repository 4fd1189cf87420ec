"""Damage that decoders overlook, found by walking the structure of a still's file."""

from __future__ import annotations

import re

_ALONE = {0x01, *range(0xD0, 0xD9)}  # markers without a length
_IN_SCAN = re.compile(rb"\xff[^\x00\xd0-\xd7\xff]", re.DOTALL)


class DamageError(ValueError):
    """Damage in a file; the message describes it."""


def check_jpeg(data: bytes) -> None:
    """Raise DamageError unless a JPEG is complete up to its end marker (ITU-T T.81, B.1).

    Decoders silently supply a missing end; of a truncated progressive file they show what the first
    scans contain.
    """
    at, has_scan = 2, False
    while True:
        while at < len(data) and data[at] != 0xFF:  # garbage between segments is skipped
            at += 1
        while at < len(data) and data[at] == 0xFF:
            at += 1
        if at >= len(data):
            break
        marker = data[at]
        if marker == 0xD9:
            if not has_scan:
                raise DamageError("it contains no picture")
            return
        if marker in _ALONE:
            at += 1
            continue
        length = int.from_bytes(data[at + 1 : at + 3], "big")
        at += 1 + max(2, length)
        if marker == 0xDA:
            has_scan = True
            found = _IN_SCAN.search(data, at)
            if found is None:
                break
            at = found.start()
    raise DamageError(f"it is truncated at byte {len(data)}")


def check_boxes(data: bytes) -> None:
    """Raise DamageError unless all boxes of a HEIF or AVIF file are complete (ISO/IEC 14496-12).

    libheif shows the tiles that exist, and a plain colour for missing ones.
    """
    at = 0
    while at < len(data):
        size, start = int.from_bytes(data[at : at + 4], "big"), 8
        if size == 1:
            size, start = int.from_bytes(data[at + 8 : at + 16], "big"), 16
        if size == 0 and len(data) - at >= 8:  # the box extends to the end of the file
            return
        if size < start:
            raise DamageError(f"its boxes are damaged at byte {at}")
        if at + size > len(data):
            raise DamageError(f"it is truncated: {at + size - len(data)} bytes are missing")
        at += size
