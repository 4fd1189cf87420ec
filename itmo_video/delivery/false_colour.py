"""False colour: luminance as colours with a legend, in stops around SDR white or in round nits.

Pure: linear BT.709 light in, 1.0 = SDR white; R'G'B' out, (H, W, 3) float32 in [0, 1].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import cv2
import numpy as np

from itmo_video.colour.primaries import LUMINANCE_WEIGHTS_BT709
from itmo_video.delivery.choices import Scale
from itmo_video.delivery.lettering import RgbPicture, text_mask, write

LEGEND_ROWS_MIN = 24
_DARKEST_STOP = -8
# The bands in nits are those of the studio and the report, viewer/false_colour.js.
ROUND_NITS = (
    0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 400, 600, 1000, 2000, 4000, 10000
)  # fmt: skip
BELOW_WHITE = ((4, 8, 28), (0, 60, 130), (86, 140, 190), (190, 205, 215))
ABOVE_WHITE = ((150, 50, 0), (230, 120, 0), (250, 190, 60), (255, 250, 225))


@dataclass(frozen=True)
class Band:
    """A step of false colour: its lowest luminance (SDR white = 1), R'G'B' and label."""

    lower: float
    colour: tuple[float, float, float]
    label: str


def false_colour(linear: RgbPicture, scale: Scale, white_nits: float, peak: float) -> RgbPicture:
    """Luminance as colours distinct for colour-blind people, with a legend below the picture.

    In nits the steps are round, blue up to SDR white and orange above; in stops they are half stops
    of cividis. `peak` is the highest luminance, SDR white = 1.
    """
    steps = bands(scale, white_nits, peak)
    luminance = linear @ np.array(LUMINANCE_WEIGHTS_BT709, np.float32)
    edges = np.array([band.lower for band in steps[1:]], np.float32)
    colours = np.array([band.colour for band in steps], np.float32)
    return np.concatenate(
        [
            colours[np.searchsorted(edges, luminance, side="right")],
            _legend(linear.shape[1], linear.shape[0], steps, scale),
        ]
    )


def bands(scale: Scale, white_nits: float, peak: float) -> tuple[Band, ...]:
    """The steps from dark to bright; the first includes everything darker, too."""
    return _of_stops(peak) if scale == "stops" else _of_nits(white_nits, peak)


def _of_stops(peak: float) -> tuple[Band, ...]:
    high = max(1, int(np.ceil(np.log2(max(peak, 1.0)))))
    stops = np.arange(_DARKEST_STOP * 2, high * 2 + 1) / 2
    level = (stops - _DARKEST_STOP) / (high - _DARKEST_STOP)
    return tuple(
        Band(float(2.0**stop), colour, f"{stop:+.0f}" if stop % 1 == 0 else "")
        for stop, colour in zip(stops, _cividis(level), strict=True)
    )


def _of_nits(white: float, peak: float) -> tuple[Band, ...]:
    # A round number next to white would leave a sliver.
    edges = [n for n in ROUND_NITS if abs(n / white - 1) > 0.1 and n < peak * white * 0.999]
    below = [0.0, *(n for n in edges if n < white)]
    above = [white, *(n for n in edges if n > white)]
    return tuple(
        Band(nits / white, _along(hues, place / max(1, len(group) - 1) if group[1:] else 1.0),
             f"{nits:g}" + (" white" if nits == white else ""))
        for group, hues in ((below, BELOW_WHITE), (above, ABOVE_WHITE))
        for place, nits in enumerate(group)
    )  # fmt: skip


def _along(hues: Sequence[tuple[int, int, int]], t: float) -> tuple[float, float, float]:
    at = min(len(hues) - 1.000001, max(0.0, t) * (len(hues) - 1))
    one, other = hues[int(at)], hues[int(at) + 1]
    red, green, blue = (np.floor(a + at % 1 * (b - a) + 0.5) / 255
                        for a, b in zip(one, other, strict=True))  # fmt: skip
    return float(red), float(green), float(blue)


def _cividis(level: Any) -> list[tuple[float, float, float]]:
    codes = np.asarray(np.round(level * 255), np.uint8)[None]
    bgr = cv2.applyColorMap(codes, cv2.COLORMAP_CIVIDIS)[0]
    return [(red / 255, green / 255, blue / 255) for blue, green, red in bgr.tolist()]


def _legend(width: int, height: int, steps: tuple[Band, ...], scale: Scale) -> RgbPicture:
    rows = max(LEGEND_ROWS_MIN, height // 14)
    edges = np.round(np.arange(len(steps) + 1) * width / len(steps)).astype(int)
    bar = np.zeros((rows, width, 3), np.float32)
    for band, (left, right) in zip(steps, pairwise(edges), strict=True):
        bar[:, left:right] = band.colour
    size = max(8, min(rows * 5 // 11, width // 30))
    written_to = 0
    for band, (left, right) in zip(steps, pairwise(edges), strict=True):
        if not band.label:
            continue
        unit = f" {scale}" if band is steps[0] else ""
        mask = text_mask(band.label + unit, size)
        if mask.shape[1] + 3 > right - left and not unit:
            mask = text_mask(band.label.split()[0], size)
        # A mark may go without its number; overlapping numbers would be illegible.
        if left < written_to or left + 3 + mask.shape[1] > width:
            continue
        ink = (
            (0.0,) * 3 if float(np.dot(band.colour, LUMINANCE_WEIGHTS_BT709)) > 0.4 else (1.0,) * 3
        )
        bar[:, left : left + 1] = ink
        write(bar, mask, (left + 3, (rows - mask.shape[0]) // 2), ink)
        written_to = left + 6 + mask.shape[1]
    return bar
