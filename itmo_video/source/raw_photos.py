"""Detecting camera raw files that look like TIFF, and TIFFs that start with a thumbnail."""

from __future__ import annotations

from itmo_video.errors import InputError
from itmo_video.source.tiff_directory import first_directory, numbers

_SUBFILE, _PHOTOMETRIC, _DNG = 254, 262, 50706
_SENSOR = ((32803,), (34892,))  # colour filter array, linear raw


def check_tiff(data: bytes, where: str) -> None:
    """Raise InputError if a TIFF's first directory is not a finished picture."""
    entries = first_directory(data)
    photometric = numbers(data, entries.get(_PHOTOMETRIC))[:1]
    is_raw = _DNG in entries or photometric in _SENSOR or data[8:10] == b"CR"
    if is_raw:
        raise InputError(
            "camera raw files are not supported",
            where=where,
            remedy="Develop it first (darktable, RawTherapee, Lightroom) and convert the result.",
        )
    if any(flags & 1 for flags in numbers(data, entries.get(_SUBFILE))[:1]):
        raise InputError(
            "the first picture in this TIFF is a thumbnail",
            where=where,
            remedy="Export the full picture as TIFF, PNG or JPEG.",
        )
