"""The properties, apart from pixels, that a frame's file must have to be up to date."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np

from itmo_video.colour.primaries import CHROMATICITIES, INTEROP_IDS
from itmo_video.output.exr import ExrImage, compression_constant, exr_rational
from itmo_video.settings import Settings

_ORDER = "LineOrder.INCREASING_Y"


@dataclass(frozen=True)
class FrameForm:
    """Size (width, height) in pixels, full channel names, and the name of the compression.

    `attributes` are those by which the pixels are read; None for one that must be absent.
    """

    size: tuple[int, int]
    channels: frozenset[str]
    compression: str
    attributes: Mapping[str, object] = field(default_factory=dict)

    def is_of(self, image: ExrImage) -> bool:
        """Whether an intact file has exactly this form, with both windows starting at (0, 0).

        A file with modified windows still opens, but with other pixels or at another position; one
        with other primaries or rate is shown in other colours or at another speed.
        """
        window = (0, 0), (self.size[0] - 1, self.size[1] - 1)
        windows = (image.attributes.get(name) for name in ("dataWindow", "displayWindow"))
        return (
            all(_corners(found) == window for found in windows)
            and set(image.channels) == self.channels
            and all(pixels.shape == self.size[::-1] for pixels in image.channels.values())
            and image.attributes.get("compression") == compression_constant(self.compression)
            and str(image.attributes.get("lineOrder")) == _ORDER
            and all(_same(image.attributes.get(n), value) for n, value in self.attributes.items())
        )


def colour_attributes(settings: Settings) -> dict[str, object]:
    """The attributes that say what the numbers of a frame with these settings mean."""
    return {
        "chromaticities": tuple(map(float, CHROMATICITIES[settings.primaries])),
        "whiteLuminance": float(settings.white_nits),
        "colorInteropID": INTEROP_IDS[settings.primaries] or None,
    }


def timing_attributes(frame_rate: Fraction, pixel_aspect: Fraction) -> dict[str, object]:
    """The attributes that say how frames of a clip are shown."""
    rate = exr_rational(frame_rate) if frame_rate > 0 else None
    return {"framesPerSecond": rate, "pixelAspectRatio": float(pixel_aspect)}


def _same(found: object, wanted: object) -> bool:
    if isinstance(wanted, float | tuple):
        if not isinstance(found, float | tuple):
            return False
        return np.array_equal(np.asarray(found, np.float32), np.asarray(wanted, np.float32))
    return found == wanted


def _corners(window: object) -> tuple[tuple[int, ...], ...]:
    return tuple(tuple(int(v) for v in corner) for corner in window)  # type: ignore[attr-defined]
