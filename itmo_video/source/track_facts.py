"""Facts about a video track from its container's boxes."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class DolbyVision:
    """The Dolby Vision configuration record: the profile and the base layer's compatibility.

    `compatibility` is 0 for none, 1 for HDR10, 2 for SDR, 4 for HLG (Dolby Vision streams in ISO
    base media, table 3).
    """

    profile: int
    compatibility: int


@dataclass(frozen=True)
class TrackFacts:
    """The sample entry's name, pixels to crop (left, top, right, bottom), Dolby Vision record."""

    sample_entry: str = ""
    crop: tuple[int, int, int, int] | None = None
    dolby_vision: DolbyVision | None = None


def dolby_vision(record: bytes | None) -> DolbyVision | None:
    """Parse a DOVIDecoderConfigurationRecord, which is the same in MP4 and Matroska."""
    if record is None or len(record) < 5:
        return None
    return DolbyVision(profile=record[2] >> 1, compatibility=record[4] >> 4)
