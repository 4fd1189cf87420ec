"""The header of a frame's EXR file."""

from __future__ import annotations

import json
from pathlib import Path

from itmo_video.colour.primaries import CHROMATICITIES, INTEROP_IDS
from itmo_video.conversion.plan import Plan
from itmo_video.model import ClipInfo, Frame
from itmo_video.output import exr
from itmo_video.settings import Settings
from itmo_video.source import timecode


def exr_header(plan: Plan, number: int, frame: Frame) -> exr.ExrHeader:
    """The header of one frame's file; `frame` is the source's."""
    look, info = plan.look_at(plan.numbers[number]), plan.clip
    settings = look.settings
    return exr.ExrHeader(
        compression=settings.compression,
        chromaticities=CHROMATICITIES[settings.primaries],
        white_nits=settings.white_nits,
        frame_rate=info.frame_rate,
        pixel_aspect=info.pixel_aspect,
        time_s=frame.time_s,
        source_name=Path(info.path).name,
        fingerprint=plan.fingerprint(number),
        settings_text=json.dumps(look.settings_in_use(), sort_keys=True),
        timecode=frame_timecode(settings, info, plan.numbers[number], number),
        interop_id=INTEROP_IDS[settings.primaries],
        owner=settings.owner,
        comments=settings.comments,
        # SMPTE ST 2065-4 requires AP0, uncompressed half floats, and no other channels.
        is_aces_container=settings.primaries == "aces2065-1"
        and settings.compression == "none"
        and not settings.layers,
        is_source_damaged=frame.is_damaged,
    )


def frame_timecode(settings: Settings, info: ClipInfo, index: int, number: int) -> str | None:
    """A frame's timecode: from the settings, or counted from the source's; None without one.

    None if EXR's timeCode cannot represent the frame rate. For a source without timecode, `auto`
    counts frame numbers from 00:00:00:00.
    """
    if not timecode.fits(info.frame_rate):
        return None
    if settings.timecode not in (None, "auto"):
        return timecode.advance(str(settings.timecode), index, info.frame_rate)
    if info.timecode is not None:
        return timecode.advance(info.timecode, index, info.frame_rate)
    if settings.timecode == "auto":
        return timecode.advance("00:00:00:00", number, info.frame_rate)
    return None
