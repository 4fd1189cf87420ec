"""The share of codes outside the assumed range, which reveals a wrong range tag."""

from __future__ import annotations

import numpy as np

from itmo_video.model import Code, Encoding
from itmo_video.source.planes import Picture

_WORTH_A_WORD = 0.01  # below this, overshoot at edges and compression explain such codes


def outside_range(picture: Picture, encoding: Encoding) -> list[str]:
    """A notice if more than 1 % of the luma codes inside any bars lie outside the limited range."""
    if encoding.range != "limited" or picture.family == "rgb":
        return []
    black, span = encoding.black_and_span
    luma = _without_bars(picture.planes[0], black)
    part = float(np.mean((luma < black) | (luma > black + span)))
    if part < _WORTH_A_WORD:
        return []
    return [
        f"{100 * part:.1f} % of the first frame's codes are outside the limited range: "
        "if the clip is full range, use --range full"
    ]


def _without_bars(luma: Code, black: float) -> Code:
    """The picture without edges below black: bars may be of code 0 whatever the range."""
    if not (luma >= black).any():
        return luma
    rows = np.flatnonzero((luma >= black).any(axis=1))
    columns = np.flatnonzero((luma >= black).any(axis=0))
    return luma[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
