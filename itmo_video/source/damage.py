"""Damage that decoders pass over, found by walking a still's own structure."""

from __future__ import annotations

import re

_ALONE = {0x01, *range(0xD0, 0xD9)}  # markers without a length
_IN_SCAN = re.compile(rb"\xff[^\x00\xd0-\xd7\xff]", re.DOTALL)


class DamageError(ValueError):
    """What is damaged in a file, in words."""


def check_jpeg(data: bytes) -> None:
    """Raise DamageError unless a JPEG goes on to its end marker (ITU-T T.81, B.1).

    Decoders put a missing end in themselves; of a progressive file that was cut they show what the
    first scans say, without a word.
    """
    at, has_scan = 2, False
    while True:
        while at < len(data) and data[at] != 0xFF:  # rubbish between segments is passed over
            at += 1
        while at < len(data) and data[at] == 0xFF:
            at += 1
        if at >= len(data):
            break
        marker = data[at]
        if marker == 0xD9:
            if not has_scan:
                raise DamageError("there is not a picture in it")
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
    raise DamageError(f"it is cut short at byte {len(data)}")


def check_boxes(data: bytes) -> None:
    """Raise DamageError unless all boxes of a HEIF or AVIF file end within it (ISO/IEC 14496-12).

    libheif shows the tiles that are there, and a plain colour for those that were cut off.
    """
    at = 0
    while at < len(data):
        size, start = int.from_bytes(data[at : at + 4], "big"), 8
        if size == 1:
            size, start = int.from_bytes(data[at + 8 : at + 16], "big"), 16
        if size == 0 and len(data) - at >= 8:  # it goes on to the end
            return
        if size < start:
            raise DamageError(f"its boxes are damaged at byte {at}")
        if at + size > len(data):
            raise DamageError(f"it is cut short: {at + size - len(data)} bytes are missing")
        at += size
