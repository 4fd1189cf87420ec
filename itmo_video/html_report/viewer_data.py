"""The data for the page's viewer: frames, scales and colours, and its modules by name."""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping, Sequence
from typing import Any

from itmo_video import viewer
from itmo_video.colour.primaries import luminance_weights, rgb_to_xyz_matrix
from itmo_video.delivery.pictures import Pictures
from itmo_video.html_report import embed, plots

MAX_WIDTH = 640


def viewer_data(
    embedded: Sequence[embed.Embedded], numbers: Sequence[int], pictures: Pictures
) -> dict[str, Any]:
    """The viewer's data as JSON values; `numbers` are those of all frames of the film."""
    peak = pictures.peak_nits / pictures.white_nits
    positions = {number: i for i, number in enumerate(numbers)}
    last = max(1, len(numbers) - 1)
    return {
        "frames": [
            {"number": e.number, "index": e.index, "size": e.size, "hdr": e.hdr,
             "source": e.source, "map": e.map} for e in embedded
        ],
        "positions": [positions[e.number] / last for e in embedded],
        "left": plots.LEFT, "across": plots.WIDTH - plots.LEFT - plots.RIGHT,
        "codes": embed.CODES, "lowest": embed.LOWEST_STOP, "highest": embed.highest_stop(peak),
        "aspect": float(pictures.pixel_aspect), "peak": peak, "white": pictures.white_nits,
        "width": MAX_WIDTH, "step_s": _step_s(embedded, pictures),
        # Pictures are embedded in BT.709.
        "primaries": {"name": "rec709", "weights": luminance_weights("rec709"),
                      "to_xyz": rgb_to_xyz_matrix("rec709").tolist()},
        "has_source": any(e.source for e in embedded), "has_map": any(e.map for e in embedded),
    }  # fmt: skip


def import_map(aces: Mapping[str, Any] | None) -> str:
    """The viewer's modules by name, embedded so that the page needs no other files."""
    imports = {
        name: f"data:text/javascript;base64,{base64.b64encode(text.encode()).decode()}"
        for name, text in viewer.modules(aces).items()
    }
    return json.dumps({"imports": imports})


def _step_s(embedded: Sequence[embed.Embedded], pictures: Pictures) -> float:
    """The average time from one frame in the page to the next, in seconds."""
    if len(embedded) < 2:
        return 1.0
    frames = (embedded[-1].index - embedded[0].index) / (len(embedded) - 1)
    return frames / float(pictures.frame_rate)
