"""ACES 2.0 output transforms, by OpenColorIO's built-in config (extra `ocio`).

Linear light is taken as scene-linear, 1.0 = SDR white = a perfect diffuser.
"""

from __future__ import annotations

import base64
import functools
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from itmo_video.colour.primaries import OCIO_NAMES
from itmo_video.colour.transfer import pq_nits
from itmo_video.delivery.lettering import RgbPicture
from itmo_video.errors import UsageError
from itmo_video.model import Float32, Half
from itmo_video.words import to_install

CONFIG = "ocio://studio-config-v4.0.0_aces-v2.0_ocio-v2.5"
HDR_PEAKS = (500, 1000, 2000, 4000)
TABLE_SIZE, TABLE_LOWEST, TABLE_HIGHEST = 33, -7, 8
_SDR = ("Rec.1886 Rec.709 - Display", "ACES 2.0 - SDR 100 nits (Rec.709)")
Planes = Sequence[Half | Float32]


def aces_sdr(rgb: Planes, primaries: str, gain: float = 1.0) -> RgbPicture:
    """Linear planes as R'G'B' in [0, 1] for a BT.1886 monitor, (H, W, 3) float32."""
    return np.clip(_shown(rgb, primaries, gain, *_SDR), np.float32(0), np.float32(1))


def aces_hdr_nits(rgb: Planes, primaries: str, peak_nits: float, gain: float = 1.0) -> RgbPicture:
    """BT.2020 R, G and B in nits, (H, W, 3) float32, for a display with one of HDR_PEAKS."""
    view = f"ACES 2.0 - HDR {peak_nits:.0f} nits (P3 D65)"
    code = _shown(rgb, primaries, gain, "Rec.2100-PQ - Display", view)
    return np.asarray(pq_nits(code), np.float32)


def aces_peak(peak_nits: float) -> float:
    """The display peak to use for a picture of this peak: the highest that does not exceed it."""
    return float(max((p for p in HDR_PEAKS if p <= peak_nits), default=HDR_PEAKS[0]))


def aces_sdr_table() -> dict[str, Any] | None:
    """The SDR view as a table for the viewer's pages, None without OpenColorIO.

    `rgb` is base64 of R'G'B' bytes, red running fastest, over `size` steps a channel of BT.709
    light: evenly in log2 of light plus 2 ** `lowest`, from 0 to 2 ** `highest`. Interpolated
    linearly it is within .3 of an 8-bit code on average, 5 at worst.
    """
    with suppress(UsageError):
        stops = np.linspace(TABLE_LOWEST, TABLE_HIGHEST, TABLE_SIZE)
        light = (np.exp2(stops) - 2.0**TABLE_LOWEST).astype(np.float32)
        blue, green, red = np.meshgrid(light, light, light, indexing="ij")
        shown = aces_sdr([plane.reshape(1, -1) for plane in (red, green, blue)], "rec709")
        codes = np.rint(shown * 255).astype(np.uint8)
        return {
            "size": TABLE_SIZE, "lowest": TABLE_LOWEST, "highest": TABLE_HIGHEST,
            "rgb": base64.b64encode(codes.tobytes()).decode(),
        }  # fmt: skip
    return None


def require_aces() -> None:
    """Raise UsageError if OpenColorIO is missing or lacks ACES 2.0."""
    _processor("rec709", *_SDR)


def _shown(rgb: Planes, primaries: str, gain: float, display: str, view: str) -> RgbPicture:
    out = np.stack([np.asarray(plane, np.float32) for plane in rgb], axis=-1) * np.float32(gain)
    _processor(primaries, display, view).applyRGB(out)  # in place
    return out


@functools.lru_cache(maxsize=4)
def _processor(primaries: str, display: str, view: str) -> Any:
    try:
        import PyOpenColorIO
    except ImportError as error:
        raise UsageError("ACES views need OpenColorIO", remedy=to_install("ocio")) from error
    try:
        config = PyOpenColorIO.Config.CreateFromFile(CONFIG)
        forward = PyOpenColorIO.TRANSFORM_DIR_FORWARD
        processor = config.getProcessor(OCIO_NAMES[primaries], display, view, forward)
        return processor.getDefaultCPUProcessor()
    except PyOpenColorIO.Exception as error:
        raise UsageError(
            f"this OpenColorIO has no ACES 2.0: {error}", remedy="pip install 'opencolorio>=2.5'"
        ) from error
