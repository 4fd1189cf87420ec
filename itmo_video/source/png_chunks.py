"""Walking and checking a PNG's chunks, to find damage before decoding."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction

from itmo_video.source.damage import DamageError

_MOST_PROFILE_BYTES = 16 << 20
_CHECKED = (b"IHDR", b"PLTE", b"IDAT", b"IEND", b"tRNS", b"fdAT", b"fcTL", b"acTL")


@dataclass
class PngFacts:
    """The contents of ancillary chunks (PNG, third edition, 11.3), None if missing.

    `cicp` is (primaries, transfer, matrix, full range) by H.273; `gamma` the exponent of encoding;
    `xy` the chromaticities of white, red, green and blue. `delays_s` are those of an animation's
    frames, of which it declares `frames`.
    """

    cicp: tuple[int, int, int, int] | None = None
    icc: bytes | None = None
    gamma: float | None = None
    xy: tuple[float, ...] | None = None
    is_srgb: bool = False
    frames: int = 0
    delays_s: list[Fraction] = field(default_factory=list)


def read_facts(data: bytes) -> PngFacts:
    """Walk a PNG file; raises DamageError if a chunk is truncated or its checksum is wrong."""
    facts = PngFacts()
    seen: set[bytes] = set()
    for name, body in _chunks(data):
        seen.add(name)
        if name == b"cICP" and len(body) >= 4:
            facts.cicp = (body[0], body[1], body[2], body[3])
        elif name == b"iCCP":
            facts.icc = _profile(body)
        elif name == b"gAMA" and len(body) >= 4:
            facts.gamma = int.from_bytes(body[:4], "big") / 100000
        elif name == b"cHRM" and len(body) >= 32:
            words = (int.from_bytes(body[at : at + 4], "big") for at in range(0, 32, 4))
            facts.xy = tuple(word / 100000 for word in words)
        elif name == b"sRGB":
            facts.is_srgb = True
        elif name == b"acTL" and len(body) >= 8:
            facts.frames = int.from_bytes(body[:4], "big")
        elif name == b"fcTL" and len(body) >= 26:
            top, bottom = (int.from_bytes(body[at : at + 2], "big") for at in (20, 22))
            facts.delays_s.append(Fraction(top, bottom or 100))
    if b"IDAT" not in seen:
        raise DamageError("it contains no picture")
    return facts


def _profile(body: bytes) -> bytes:
    """The profile of an iCCP chunk (libpng drops some); empty if it is damaged."""
    try:
        return zlib.decompressobj().decompress(body[body.index(b"\0") + 2 :], _MOST_PROFILE_BYTES)
    except (ValueError, zlib.error):
        return b""


def _chunks(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    at = 8
    while True:
        name = data[at + 4 : at + 8]
        length = int.from_bytes(data[at : at + 4], "big")
        if len(name) < 4 or at + 12 + length > len(data):
            raise DamageError(f"it is truncated at byte {len(data)}")
        body = data[at + 8 : at + 8 + length]
        if name in _CHECKED:
            stated = int.from_bytes(data[at + 8 + length : at + 12 + length], "big")
            if zlib.crc32(body, zlib.crc32(name)) != stated:
                raise DamageError(f"chunk {name.decode('latin-1')} at byte {at} is damaged")
        yield name, body
        if name == b"IEND":
            return
        at += 12 + length
