"""HDR10's static metadata: options for encoders, and completing the finished film.

MaxCLL and MaxFALL are known after the last frame, but encoders need them before the first. They get
placeholders, which are overwritten in place in the finished file, so that a film is rendered once,
not twice. Containers of the MP4 family also get `mdcv` and `clli` boxes.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from itmo_video.colour.primaries import CHROMATICITIES
from itmo_video.delivery.hdr import Light

# 42405 nits, average 58025: no real film has these, and they have no zero bytes to be escaped.
PLACEHOLDER = (0xA5A5, 0xE2A9)
_PLACED = struct.pack(">2H", *PLACEHOLDER)
# Complete units, so that four bytes of picture data are never mistaken for metadata: an SEI NAL
# unit with payload 144 of 4 bytes and its stop bit (H.265 D.2.35); an OBU of type 5, size 6, with
# metadata_type 1 and its trailing bit (AV1 5.8.2).
_UNITS = {
    "hevc": b"\x4e\x01\x90\x04" + _PLACED + b"\x80",
    "av1": b"\x2a\x06\x01" + _PLACED + b"\x80",
}
_BLOCK = 1 << 22


@dataclass(frozen=True)
class Mastering:
    """The mastering display: chromaticities (rx, ry, gx, gy, bx, by, wx, wy) and nits."""

    chromaticities: tuple[float, ...]
    peak_nits: float
    black_nits: float = 0.005

    def for_x265(self) -> str:
        """x265's master-display: 1/50000 of a chromaticity, 1/10000 nit; green, blue, red."""
        rx, ry, gx, gy, bx, by, wx, wy = (round(v * 50000) for v in self.chromaticities)
        top, low = in_32_bits(self.peak_nits), in_32_bits(self.black_nits)
        return f"G({gx},{gy})B({bx},{by})R({rx},{ry})WP({wx},{wy})L({top},{low})"

    def for_svt(self) -> str:
        """SVT-AV1's mastering-display: plain numbers in the same order."""
        rx, ry, gx, gy, bx, by, wx, wy = self.chromaticities
        return (
            f"G({gx},{gy})B({bx},{by})R({rx},{ry})WP({wx},{wy})"
            f"L({self.peak_nits:.4f},{self.black_nits:.4f})"
        )

    def box(self) -> bytes:
        """The payload of an `mdcv` box (ISO/IEC 14496-12): green, blue, red, white."""
        rx, ry, gx, gy, bx, by, wx, wy = (round(v * 50000) for v in self.chromaticities)
        top, low = in_32_bits(self.peak_nits), in_32_bits(self.black_nits)
        return struct.pack(">8H2I", gx, gy, bx, by, rx, ry, wx, wy, top, low)

    def png_chunk(self) -> bytes:
        """The payload of PNG's mDCV chunk (PNG 3rd edition, 11.3.2.7): red, green, blue, white."""
        xy = (round(v * 50000) for v in self.chromaticities)
        return struct.pack(">8H2I", *xy, in_32_bits(self.peak_nits), in_32_bits(self.black_nits))


def mastering(peak_nits: float) -> Mastering:
    """The mastering display to state: P3-D65, as is usual for HDR10, with this peak."""
    return Mastering(CHROMATICITIES["p3d65"], peak_nits)


def in_32_bits(nits: float) -> int:
    """The field's value in 1/10000 nit, at most 429,496.7295 nits."""
    return min(round(nits * 10000), 2**32 - 1)


def complete_light(path: Path, codec: str, light: Light) -> int:
    """Overwrite the placeholders of a finished file with MaxCLL and MaxFALL; returns the number.

    Lengths do not change, so offsets and indices of any container stay valid. For codecs without
    such units (ProRes) the number is 0.
    """
    if codec not in _UNITS:
        return 0
    unit = _UNITS[codec]
    written = unit.replace(_PLACED, struct.pack(">2H", *_unescaped(light)))
    count = 0
    with path.open("r+b") as file:
        for position in _positions(file, unit):
            file.seek(position)
            file.write(written)
            count += 1
    return count


def add_boxes(path: Path, mastering: Mastering, light: Light) -> bool:
    """Append `mdcv` and `clli` boxes to the video sample entry of a finished MP4 or MOV file.

    The `moov` box must come last, as it does without "fast start", so that no offset's target
    moves. Returns whether they were added (ISO/IEC 14496-12, 12.1.6 and .7).
    """
    cll, fall = light.as_integers
    boxes = _box(b"mdcv", mastering.box()) + _box(b"clli", struct.pack(">2H", cll, fall))
    with path.open("r+b") as file:
        moov = _last_box(file)
        if moov is None:
            return False
        start, data = moov
        grown = _grown(data, _PATH, boxes)
        if grown is None:
            return False
        file.seek(start)
        file.write(grown)
    return True


_PATH = (b"moov", b"trak", b"mdia", b"minf", b"stbl", b"stsd")
_VIDEO_ENTRIES = (b"av01", b"hvc1", b"hev1", b"apch", b"ap4h", b"AVdh")
_ENTRY_HEAD = 86  # of a VisualSampleEntry: box header and fixed fields


def _unescaped(light: Light) -> tuple[int, int]:
    """The two numbers, with MaxCLL raised by one nit if H.265 would have to escape zeros.

    An escape would lengthen the unit. It occurs if MaxCLL is a multiple of 256 and MaxFALL < 4.
    """
    cll, fall = light.as_integers
    return (cll + 1 if cll % 256 == 0 and fall < 4 else cll), fall


def _positions(file: BinaryIO, unit: bytes) -> Iterator[int]:
    base, tail = 0, b""
    while True:
        file.seek(base)
        block = file.read(_BLOCK)
        if not block:
            return
        data = tail + block
        at = data.find(unit)
        while at >= 0:
            yield base - len(tail) + at
            at = data.find(unit, at + 1)
        base += len(block)
        tail = data[-(len(unit) - 1) :]


def _box(kind: bytes, payload: bytes) -> bytes:
    return struct.pack(">I", len(payload) + 8) + kind + payload


def _last_box(file: BinaryIO) -> tuple[int, bytes] | None:
    """(start, content) of the file's last box if that is its `moov`."""
    file.seek(0, 2)
    end = file.tell()
    start = 0
    while start + 8 <= end:
        file.seek(start)
        size, kind = struct.unpack(">I4s", file.read(8))
        if size == 1:
            (size,) = struct.unpack(">Q", file.read(8))
        if kind == b"moov":
            file.seek(start)
            return (start, file.read(size)) if start + size == end else None
        if size < 8:
            return None
        start += size
    return None


def _grown(box: bytes, path: tuple[bytes, ...], boxes: bytes) -> bytes | None:
    """The box with `boxes` appended to the video entry within it; None if there is none."""
    if box[4:8] != path[0]:
        return None
    is_last = len(path) == 1
    head = 16 if is_last else 8  # stsd is a full box with a count
    inner, position, done = b"", head, False
    while position + 8 <= len(box):
        size = struct.unpack_from(">I", box, position)[0]
        if size < 8:
            return None
        child = box[position : position + size]
        if not done:
            if is_last:
                wanted = child[4:8] in _VIDEO_ENTRIES and size >= _ENTRY_HEAD
                # QuickTime may end an entry with four zero bytes, where readers would stop.
                trimmed = child[:-4] if child.endswith(b"\0\0\0\0") and _ends(child) else child
                grown = _resized(trimmed + boxes) if wanted else None
            else:
                grown = _grown(child, path[1:], boxes)
            if grown is not None:
                child, done = grown, True
        inner += child
        position += size
    return _resized(box[:head] + inner) if done else None


def _ends(entry: bytes) -> bool:
    """Whether exactly four bytes follow the entry's child boxes."""
    position = _ENTRY_HEAD
    while position + 8 <= len(entry):
        position += max(8, struct.unpack_from(">I", entry, position)[0])
    return position == len(entry) - 4


def _resized(box: bytes) -> bytes:
    return struct.pack(">I", len(box)) + box[4:]
