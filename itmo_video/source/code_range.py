"""The share of codes outside the assumed range, which reveals a wrong range tag."""

from __future__ import annotations

import numpy as np

from itmo_video.model import Encoding
from itmo_video.source.planes import Picture

_WORTH_A_WORD = 0.01  # below this, overshoot at edges and compression explain such codes


def outside_range(picture: Picture, encoding: Encoding) -> list[str]:
    """A notice if more than 1 % of the luma codes lie outside the limited range."""
    if encoding.range != "limited" or picture.family == "rgb":
        return []
    black, span = encoding.black_and_span
    luma = picture.planes[0]
    part = float(np.mean((luma < black) | (luma > black + span)))
    if part < _WORTH_A_WORD:
        return []
    return [
        f"{100 * part:.1f} % of the first frame's codes are outside the limited range: "
        "if the clip is full range, use --range full"
    ]
