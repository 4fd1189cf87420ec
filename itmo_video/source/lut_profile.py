"""ICC profiles with tables, for RGB, grey and CMYK, applied by LittleCMS (Pillow) in 8 bits."""

from __future__ import annotations

import io
from typing import Any

import numpy as np

from itmo_video.model import Code
from itmo_video.source.icc import ProfileError, rec2020_profile
from itmo_video.source.still_picture import split


def to_rec2020(image: Any, profile: bytes) -> tuple[Code, ...]:
    """A Pillow image (modes L, RGB, CMYK) as R, G, B: Rec. 2020 primaries, the sRGB curve.

    8 bits, relative colorimetric. Raises ProfileError if LittleCMS cannot use the profile.
    """
    from PIL import ImageCms

    try:
        convert = ImageCms.buildTransform(
            io.BytesIO(profile),
            io.BytesIO(rec2020_profile()),
            image.mode,
            "RGB",
            ImageCms.Intent.RELATIVE_COLORIMETRIC,
            ImageCms.Flags.HIGHRESPRECALC,
        )
        converted = ImageCms.applyTransform(image, convert)
    except (ImageCms.PyCMSError, ValueError, OSError) as error:
        raise ProfileError(f"LittleCMS cannot use it ({error})") from error
    return split(np.asarray(converted))


def image_of(planes: tuple[Code, ...], bit_depth: int) -> Any:
    """An 8-bit Pillow image from grey or R, G, B planes."""
    from PIL import Image

    shift = bit_depth - 8
    top = (1 << bit_depth) - 1

    def eight(plane: Code) -> Code:
        if shift == 0:
            return plane
        return np.asarray((plane.astype(np.uint32) * 255 + top // 2) // top, np.uint8)

    pixels = [eight(plane) for plane in planes]
    return Image.fromarray(pixels[0] if len(pixels) == 1 else np.dstack(pixels))
