"""The header of a frame's EXR file."""

from __future__ import annotations

import json
from fractions import Fraction
from pathlib import Path

from itmo_video.colour.primaries import CHROMATICITIES
from itmo_video.conversion import timecode
from itmo_video.conversion.plan import Plan
from itmo_video.output import exr


def exr_header(plan: Plan, number: int, time_s: Fraction) -> exr.ExrHeader:
    """The header of one frame's file."""
    settings, info = plan.look_at(plan.numbers[number]).settings, plan.clip
    chromaticities = CHROMATICITIES[settings.primaries]
    code = None
    if info.timecode is not None:
        code = timecode.advance(info.timecode, plan.numbers[number], info.frame_rate)
    return exr.ExrHeader(
        compression=settings.compression,
        chromaticities=(
            chromaticities[0], chromaticities[1], chromaticities[2], chromaticities[3],
            chromaticities[4], chromaticities[5], chromaticities[6], chromaticities[7],
        ),
        white_nits=settings.white_nits,
        frame_rate=info.frame_rate,
        pixel_aspect=info.pixel_aspect,
        time_s=time_s,
        source_name=Path(info.path).name,
        fingerprint=plan.fingerprint(number),
        settings_text=json.dumps(settings.as_dict(), sort_keys=True),
        timecode=code,
        # SMPTE ST 2065-4 wants AP0, uncompressed half, and nothing but the picture.
        is_aces_container=settings.primaries == "aces2065-1"
        and settings.compression == "none"
        and not settings.layers,
    )  # fmt: skip
