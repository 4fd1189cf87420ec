"""HDR10's static metadata in an AVIF still: the item properties `clli` and `mdcv`.

FFmpeg's muxer writes neither, so they are added to the finished file (ISO/IEC 23008-12, 6.5; boxes
of ISO/IEC 14496-12, 12.1.6 and 12.1.7): the picture's data moves down, and `iloc` is updated.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

from itmo_video.delivery.hdr import Light
from itmo_video.delivery.metadata import Mastering
from itmo_video.errors import OutputError

Box = tuple[bytes, bytes]


def with_light(avif: bytes, mastering: Mastering, light: Light, where: str) -> bytes:
    """The file with both properties added to its single picture; OutputError for other layouts.

    `where` is its name, for the error.
    """
    cll, fall = light.as_integers
    added = ((b"clli", struct.pack(">2H", cll, fall)), (b"mdcv", mastering.box()))
    try:
        return _with_properties(avif, added)
    except (struct.error, ValueError, StopIteration) as error:
        raise OutputError(
            "light levels cannot be added to an AVIF of this layout",
            where=where,
            remedy="Name it .png, which states them, too.",
        ) from error


def _with_properties(avif: bytes, added: Sequence[Box]) -> bytes:
    top = _boxes(avif)
    meta = next(body for kind, body in top if kind == b"meta")
    inside = _boxes(meta[4:])  # a full box starts with version and flags
    properties = _boxes(next(body for kind, body in inside if kind == b"iprp"))
    ipco = _boxes(next(body for kind, body in properties if kind == b"ipco"))
    ipma = next(body for kind, body in properties if kind == b"ipma")
    numbers = range(len(ipco) + 1, len(ipco) + 1 + len(added))
    iprp = _written([(b"ipco", _written([*ipco, *added])), (b"ipma", _associated(ipma, numbers))])
    iloc = next(body for kind, body in inside if kind == b"iloc")
    changed = {b"iprp": iprp, b"iloc": _moved(iloc, len(iprp) - len(_written(properties)))}
    new = meta[:4] + _written([(kind, changed.get(kind, body)) for kind, body in inside])
    return _written([(kind, new if kind == b"meta" else body) for kind, body in top])


def _boxes(data: bytes) -> list[Box]:
    found, at = [], 0
    while at < len(data):
        size, kind = struct.unpack_from(">I4s", data, at)
        if size < 8 or at + size > len(data):
            raise ValueError("unexpected box")
        found.append((kind, data[at + 8 : at + size]))
        at += size
    return found


def _written(boxes: Sequence[Box]) -> bytes:
    return b"".join(struct.pack(">I4s", 8 + len(body), kind) + body for kind, body in boxes)


def _associated(ipma: bytes, numbers: Sequence[int]) -> bytes:
    """`ipma` of one item with these properties added as non-essential."""
    version_flags, items, _, count = struct.unpack_from(">IIHB", ipma)
    if version_flags != 0 or items != 1 or max(numbers) > 127:
        raise ValueError("unexpected ipma")
    return ipma[:10] + bytes([count + len(numbers)]) + ipma[11:] + bytes(numbers)


def _moved(iloc: bytes, by: int) -> bytes:
    """`iloc` of one item in one extent, with its data moved down by a number of bytes."""
    head, sizes, items, _, _, extents, offset, length = struct.unpack(">I5H2I", iloc)
    if head != 0 or sizes != 0x4400 or items != 1 or extents != 1:
        raise ValueError("unexpected iloc")
    return iloc[:-8] + struct.pack(">II", offset + by, length)
