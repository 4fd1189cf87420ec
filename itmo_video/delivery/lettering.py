"""Text on pictures: labels on plates, and legends, in the font included in Pillow.

Pictures are (H, W, 3) float32, linear or not; 1.0 is written as white.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Literal

import numpy as np
import numpy.typing as npt

from itmo_video.model import Float32

RgbPicture = npt.NDArray[np.float32]  # (height, width, 3)
Side = Literal["left", "right"]

_SMALLEST_PX = 9
_PLATE = np.float32(0.25)  # the share of the picture's light kept behind a label


def label_size(picture: RgbPicture) -> int:
    """The height of a label's letters in pixels: small, but legible at viewing distance."""
    height, width = picture.shape[:2]
    return max(_SMALLEST_PX, min(int(height), int(width)) // 28)


def labelled(picture: RgbPicture, texts: Sequence[str], side: Side = "left") -> RgbPicture:
    """A copy with the first of `texts` that fits in a bottom corner, on a darkened plate.

    `texts` go from longest to shortest; the last is truncated if it does not fit either.
    """
    height, width = picture.shape[:2]
    size = label_size(picture)
    pad = max(2, size // 3)
    masks = [text_mask(text, size) for text in texts]
    mask = next((m for m in masks if m.shape[1] + 4 * pad <= width), masks[-1])
    mask = mask[: max(0, height - 3 * pad), : max(0, width - 4 * pad)]
    rows, columns = mask.shape[0] + 2 * pad, mask.shape[1] + 2 * pad
    bottom = height - pad
    left = pad if side == "left" else width - pad - columns
    out = picture.copy()
    out[bottom - rows : bottom, left : left + columns] *= _PLATE
    write(out, mask, (left + pad, bottom - rows + pad), (1.0, 1.0, 1.0))
    return out


def write(picture: RgbPicture, mask: Float32, at: tuple[int, int], ink: Sequence[float]) -> None:
    """Blend `ink` into the picture by `mask`, with its top left corner `at` (x, y), cropped."""
    x, y = at
    target = picture[y : y + mask.shape[0], x : x + mask.shape[1]]
    cover = mask[: target.shape[0], : target.shape[1], None]
    target += cover * (np.asarray(ink, np.float32) - target)


@functools.lru_cache(maxsize=256)
def text_mask(text: str, size_px: int) -> Float32:
    """The coverage of each pixel by the text, 0 to 1; all texts of one size have one height."""
    from PIL import Image, ImageDraw, ImageFont

    font = ImageFont.load_default(size_px)
    assert isinstance(font, ImageFont.FreeTypeFont)
    ascent, descent = font.getmetrics()
    width = max(1, int(np.ceil(font.getlength(text))) + 1)
    mask = Image.new("L", (width, ascent + descent))
    ImageDraw.Draw(mask).text((0, 0), text, fill=255, font=font)
    return np.asarray(mask, np.float32) / np.float32(255)
