"""The format and size of a still from its first bytes, before any library opens it."""

from __future__ import annotations

from typing import Literal

StillFormat = Literal[
    "png", "apng", "jpeg", "tiff", "jpeg2000", "dpx", "cineon", "bmp", "pnm", "psd", "qoi", "gif",
    "webp", "avif", "heif", "jpegxl",
]  # fmt: skip

HEAD_BYTES = 4096  # that `still_format` needs

_MAGIC: tuple[tuple[bytes, StillFormat], ...] = (
    (b"\x89PNG\r\n\x1a\n", "png"), (b"\xff\xd8\xff", "jpeg"),
    (b"II*\0", "tiff"), (b"MM\0*", "tiff"), (b"II+\0", "tiff"), (b"MM\0+", "tiff"),
    (b"\0\0\0\x0cjP  ", "jpeg2000"), (b"\xff\x4f\xff\x51", "jpeg2000"),
    (b"SDPX", "dpx"), (b"XPDS", "dpx"), (b"\x80\x2a\x5f\xd7", "cineon"),
    (b"\xd7\x5f\x2a\x80", "cineon"), (b"qoif", "qoi"), (b"8BPS", "psd"), (b"GIF8", "gif"),
    (b"\0\0\0\x0cJXL ", "jpegxl"), (b"\xff\x0a", "jpegxl"),
)  # fmt: skip
_FLOAT_MAGIC = (b"\x76\x2f\x31\x01", b"#?RADIANCE", b"#?RGBE", b"PF\n", b"Pf\n")


def is_float_image(head: bytes) -> bool:
    """Whether a file with this head is a floating-point image: OpenEXR, Radiance or PFM."""
    return head.startswith(_FLOAT_MAGIC)


def still_format(head: bytes, suffix: str = "") -> StillFormat | None:
    """The format of a still by a file's first 4 KB; None if it is not a still.

    A `suffix` of .mjpeg or .mjpg means motion JPEG. HEIF films (brands hevc and msf1) are left to
    the reader of films.
    """
    if head[:4] == b"RIFF" and head[8:12] == b"WEBP":
        return "webp"
    if head[:2] == b"BM" and head[6:10] == b"\0\0\0\0":
        return "bmp"
    if head[:1] == b"P" and head[1:2] in b"123456" and head[2:3] in (b"\n", b" ", b"\r", b"\t"):
        return "pnm"
    if head[4:8] == b"ftyp":
        return _iso_media(head)
    found = next((name for magic, name in _MAGIC if head.startswith(magic)), None)
    if found == "jpeg" and suffix.lower() in (".mjpeg", ".mjpg"):
        return None
    if found == "png" and b"acTL" in head:
        return "apng"
    return found


def _iso_media(head: bytes) -> StillFormat | None:
    size = min(int.from_bytes(head[:4], "big"), len(head))
    brands = {head[at : at + 4] for at in (8, *range(16, size, 4))}
    if brands & {b"avif", b"avis"}:
        return "avif"
    major = head[8:12]
    if major in (b"hevc", b"hevx", b"msf1") and not brands & {b"heic", b"heix"}:
        return None
    return "heif" if brands & {b"heic", b"heix", b"mif1", b"heim", b"heis"} else None


def stated_size(data: bytes, kind: StillFormat) -> tuple[int, int] | None:
    """(width, height) stated by a header, for formats that libraries decode while opening.

    None if the library reports the size before decoding, or none is stated.
    """
    if kind == "webp":
        return _webp_size(data)
    if kind == "jpeg2000":
        return _codestream_size(data)
    if kind == "gif" and len(data) >= 10:
        return int.from_bytes(data[6:8], "little"), int.from_bytes(data[8:10], "little")
    if kind == "psd" and len(data) >= 26:
        return int.from_bytes(data[18:22], "big"), int.from_bytes(data[14:18], "big")
    if kind == "qoi" and len(data) >= 14:
        return int.from_bytes(data[4:8], "big"), int.from_bytes(data[8:12], "big")
    if kind in ("png", "apng") and data[12:16] == b"IHDR":
        return int.from_bytes(data[16:20], "big"), int.from_bytes(data[20:24], "big")
    return None


def _webp_size(data: bytes) -> tuple[int, int] | None:
    kind, body = data[12:16], data[20:34]
    if kind == b"VP8X" and len(body) >= 10:
        width, height = (int.from_bytes(body[at : at + 3], "little") + 1 for at in (4, 7))
        return width, height
    if kind == b"VP8L" and len(body) >= 5:  # RFC 9649, 3.4: two sizes of 14 bits
        bits = int.from_bytes(body[1:5], "little")
        return (bits & 0x3FFF) + 1, (bits >> 14 & 0x3FFF) + 1
    if kind == b"VP8 " and len(body) >= 10:  # RFC 6386, 9.1
        width, height = (int.from_bytes(body[at : at + 2], "little") & 0x3FFF for at in (6, 8))
        return width, height
    return None


def _codestream_size(data: bytes) -> tuple[int, int] | None:
    at = data.find(b"\xff\x4f\xff\x51")  # ISO/IEC 15444-1, A.5.1: SOC, then SIZ
    if at < 0 or len(data) < at + 24:
        return None
    right, bottom, left, top = (
        int.from_bytes(data[at + 8 + 4 * i : at + 12 + 4 * i], "big") for i in range(4)
    )
    return max(0, right - left), max(0, bottom - top)


def cinema_profile(data: bytes) -> bool:
    """Whether a JPEG 2000 codestream has a digital cinema profile, so X'Y'Z' (SMPTE 428)."""
    at = data.find(b"\xff\x4f\xff\x51")
    # ISO/IEC 15444-1, table A.10: Rsiz of 2K, 4K, and of both scalable
    return at >= 0 and int.from_bytes(data[at + 6 : at + 8], "big") in (3, 4, 5, 6)
