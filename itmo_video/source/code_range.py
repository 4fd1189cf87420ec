"""How many codes lie outside of the range that they are read by: a wrong tag shows itself so."""

from __future__ import annotations

import numpy as np

from itmo_video.model import Encoding
from itmo_video.source.planes import Picture

_WORTH_A_WORD = 0.01  # below it, edges and compression account for such codes


def outside_range(picture: Picture, encoding: Encoding) -> list[str]:
    """A notice where more than one in a hundred luma codes is outside of the limited range."""
    if encoding.range != "limited" or picture.family == "rgb":
        return []
    black, span = encoding.black_and_span
    luma = picture.planes[0]
    part = float(np.mean((luma < black) | (luma > black + span)))
    if part < _WORTH_A_WORD:
        return []
    return [
        f"{100 * part:.1f} % of the first frame's codes are outside of the limited range: "
        "is it full range (--range full)?"
    ]
