"""Dynamic metadata in the formats of common tools: HDR10+ JSON and Dolby Vision level 1.

HDR10+ is SMPTE ST 2094-40, in the JSON of hdr10plus_tool and x265 (profile A: measured light, no
curves). Dolby Vision is the JSON of `dovi_tool generate`, profile 8.1.
"""

from __future__ import annotations

import json
from importlib.metadata import version
from typing import Any

import numpy as np

from itmo_video.colour.transfer import pq_code
from itmo_video.delivery.metadata import mastering
from itmo_video.delivery.shot_light import FilmLight, ShotLight, starts_and_lengths

# The names of ST 2094-40's nine values, which are percentiles except for two that HDR10+ has
# redefined (DistributionY99 and DistributionY100nit).
DISTRIBUTION_INDEX = (1, 5, 10, 25, 50, 75, 90, 95, 99)
_PERCENTILES = {1: 1.0, 5: 99.99, 25: 25.0, 50: 50.0, 75: 75.0, 90: 90.0, 95: 95.0, 99: 99.98}
_SHARE_OF_100_NITS = 10
# Level 1 in content mapping 4.0: the limits of its 12-bit values that decoders expect.
MIN_PQ_AT_MOST, MAX_PQ_AT_LEAST, AVG_PQ_AT_LEAST = 12, 2081, 1229


def hdr10plus(film: FilmLight) -> dict[str, Any]:
    """The document for `hdr10plus_tool inject` and `x265 --dhdr10-info`: one entry per frame.

    Light is linear max(R, G, B) in tenths of a nit, over all pixels of the shot.
    """
    entries = [
        {
            "LuminanceParameters": parameters,
            "NumberOfWindows": 1,
            "TargetedSystemDisplayMaximumLuminance": 0,
            "SceneFrameIndex": index,
            "SceneId": scene,
            "SequenceFrameIndex": shot.first + index,
        }
        for scene, shot in enumerate(film.shots)
        for parameters in [_luminance_parameters(shot)]
        for index in range(shot.frames)
    ]
    starts, lengths = starts_and_lengths(film.shots)
    return {
        "JSONInfo": {"HDR10plusProfile": "A", "Version": "1.0"},
        "SceneInfo": entries,
        "SceneInfoSummary": {"SceneFirstFrameIndex": starts, "SceneFrameNumbers": lengths},
        "ToolInfo": {"Tool": "itmo_video", "Version": version("itmo_video")},
    }


def dolby_vision(film: FilmLight) -> dict[str, Any]:
    """The document for `dovi_tool generate -j`: level 1 per shot, level 6 as in HDR10."""
    cll, fall = film.light.as_integers
    display = mastering(film.peak_nits)
    return {
        "cm_version": "V40",
        "profile": "8.1",
        "length": film.frames,
        "level6": {
            "max_display_mastering_luminance": round(display.peak_nits),
            "min_display_mastering_luminance": round(display.black_nits * 10000),
            "max_content_light_level": cll,
            "max_frame_average_light_level": fall,
        },
        "shots": [
            {
                "start": shot.first,
                "duration": shot.frames,
                "metadata_blocks": [{"Level1": level1(shot)}],
            }
            for shot in film.shots
        ],
    }


def level1(shot: ShotLight) -> dict[str, int]:
    """Minimum, maximum and mean of max(R, G, B) as 12-bit PQ, within decoders' limits."""
    lowest, highest = (
        round(4095 * float(pq_code(np.array(nits))))
        for nits in (shot.lowest_nits, max(shot.maxima_nits))
    )
    highest = max(highest, MAX_PQ_AT_LEAST)
    mean = min(max(round(4095 * shot.mean_pq), AVG_PQ_AT_LEAST), highest - 1)
    return {"min_pq": min(lowest, MIN_PQ_AT_MOST), "max_pq": highest, "avg_pq": mean}


def as_text(document: dict[str, Any]) -> str:
    """JSON, indented as these tools write it."""
    return json.dumps(document, indent=2, allow_nan=False) + "\n"


def _luminance_parameters(shot: ShotLight) -> dict[str, Any]:
    values = [
        round(shot.share_within(100)) if index == _SHARE_OF_100_NITS
        else shot.percentile(_PERCENTILES[index])
        for index in DISTRIBUTION_INDEX
    ]  # fmt: skip
    return {
        "AverageRGB": _tenths(shot.mean_nits),
        "LuminanceDistributions": {
            "DistributionIndex": list(DISTRIBUTION_INDEX),
            "DistributionValues": values,
        },
        "MaxScl": [_tenths(nits) for nits in shot.maxima_nits],
    }


def _tenths(nits: float) -> int:
    return min(round(nits * 10), 100_000)
