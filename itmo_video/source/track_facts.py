"""A video track's facts that come from its container's own boxes."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class DolbyVision:
    """Its configuration record: the profile, and what its base layer is to other players.

    `compatibility` is 0 for none, 1 for HDR10, 2 for SDR, 4 for HLG (Dolby Vision streams in ISO
    base media, table 3).
    """

    profile: int
    compatibility: int


@dataclass(frozen=True)
class TrackFacts:
    """The sample entry's name, pixels to crop (left, top, right, bottom), Dolby Vision's record."""

    sample_entry: str = ""
    crop: tuple[int, int, int, int] | None = None
    dolby_vision: DolbyVision | None = None


def dolby_vision(record: bytes | None) -> DolbyVision | None:
    """Parse a DOVIDecoderConfigurationRecord, as MP4 and Matroska hold it alike."""
    if record is None or len(record) < 5:
        return None
    return DolbyVision(profile=record[2] >> 1, compatibility=record[4] >> 4)
