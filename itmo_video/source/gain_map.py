"""Detecting HDR gain maps in stills; only the SDR base picture is read."""

from __future__ import annotations

_MARKS = (
    b"hdrgm:Version",  # Adobe's and Android's, in XMP
    b"urn:iso:std:iso:ts:21496:-1",  # ISO 21496-1 in JPEG
    b"urn:com:apple:photo:2020:aux:hdrgainmap",  # Apple's, HEIC
    b"apdi:AuxiliaryImageType>urn:com:apple:photo:2020:aux:hdrgainmap",
    b"HDRGainMapVersion",  # Apple's, JPEG
)

NOTICE = (
    "contains an HDR gain map, which is ignored: the SDR base picture is read. For the original "
    "HDR picture, apply the gain map (libultrahdr, or export HDR from a photo editor)"
)


def has_gain_map(data: bytes, kind: str) -> bool:
    """Whether the file contains a gain map of any known kind."""
    if kind not in ("jpeg", "heif", "avif", "jpegxl"):
        return False
    if kind in ("heif", "avif") and b"tmap" in data[:65536]:  # ISO 21496-1's derived item
        return True
    return any(mark in data for mark in _MARKS)
