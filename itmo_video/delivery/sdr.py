"""HDR pictures for SDR monitors: tone-mapped, at several exposures, side by side.

Pure: linear light in, 1.0 = SDR white; pictures out are nonlinear R'G'B' in [0, 1], float32
(height, width, 3), BT.709 primaries.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence

import cv2
import numpy as np

from itmo_video.colour import linear_light
from itmo_video.colour.primaries import rgb_to_rgb_matrix
from itmo_video.colour.transfer import BT1886_GAMMA
from itmo_video.delivery.choices import Layout
from itmo_video.delivery.eetf import bt2390_eetf
from itmo_video.delivery.half_tables import all_halves
from itmo_video.delivery.lettering import RgbPicture, labelled
from itmo_video.model import Float32, Frame, Half
from itmo_video.operators import filmic
from itmo_video.rendering.frame import alpha_of


def reinhard(level: Float32, peak: float) -> Float32:
    """Reinhard et al. 2002, eq. 4: white at `peak`, 1 at most."""
    return np.asarray(level * (1 + level / peak**2) / (1 + level), np.float32)


def hable(level: Float32, peak: float) -> Float32:
    """J. Hable's filmic curve (Uncharted 2, GDC 2010), scaled so that `peak` is 1."""
    return np.asarray(filmic.forward(2 * level, 2 * peak), np.float32)


def aces(level: Float32, peak: float) -> Float32:
    """K. Narkowicz's fit of the ACES output curve (2015), which has no peak."""
    x = 0.6 * level
    return np.asarray(
        np.clip(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14), 0, 1), np.float32
    )


def bt2390(level: Float32, peak: float) -> Float32:
    """ITU-R BT.2390-10's EETF for a display whose peak is 203 nits, SDR white."""
    return np.asarray(bt2390_eetf(level * 203.0, 203.0 * peak, 203.0) / 203.0, np.float32)


def clip(level: Float32, peak: float) -> Float32:
    """Clipping, as on an SDR monitor: everything above white is white."""
    return np.minimum(level, np.float32(1))


TONE_MAPS: dict[str, Callable[[Float32, float], Float32]] = {
    "bt2390": bt2390,
    "reinhard": reinhard,
    "hable": hable,
    "aces": aces,
    "clip": clip,
}


def to_709(rgb: Sequence[Half | Float32], primaries: str) -> RgbPicture:
    """Linear RGB planes in any primaries as one (H, W, 3) float32 picture in BT.709, >= 0."""
    picture = np.dstack([np.asarray(plane, np.float32) for plane in rgb])
    if primaries != "rec709":
        matrix = rgb_to_rgb_matrix(primaries, "rec709")
        picture = np.asarray(cv2.transform(picture, matrix.astype(np.float32)), np.float32)
    return np.maximum(picture, np.float32(0))


def tone_mapped(linear: RgbPicture, name: str, peak: float) -> RgbPicture:
    """A picture tone-mapped to SDR R'G'B', with the curve on max(R, G, B) to keep hue."""
    level = linear.max(axis=2)
    table = _tone_table(name, peak)
    factor = cv2.LUT(np.minimum(level, 65504).astype(np.float16).view(np.uint16), table)
    return encoded(linear * np.asarray(factor, np.float32).reshape(*level.shape, 1))


def encoded(linear: RgbPicture) -> RgbPicture:
    """Linear light as R'G'B' for a BT.1886 monitor, clipped to [0, 1]."""
    return np.asarray(np.clip(linear, 1e-9, 1) ** np.float32(1 / BT1886_GAMMA), np.float32)


def source_picture(frame: Frame) -> RgbPicture:
    """A source frame as linear (H, W, 3) light in BT.709; over black where it has alpha."""
    picture = to_709(linear_light.to_rgb_linear(frame, clip=True), frame.encoding.primaries)
    alpha = alpha_of(frame)
    return picture if alpha is None else picture * alpha[..., None]


def composed(
    source: RgbPicture, result: RgbPicture, layout: Layout, wipe_at: float = 0.5
) -> RgbPicture:
    """Source and result side by side, or as a wipe with the source left of `wipe_at` (0 to 1)."""
    if layout == "side":
        return np.concatenate([source, result], axis=1)
    column = round(wipe_at * source.shape[1])
    out = result.copy()
    out[:, :column] = source[:, :column]
    out[:, max(0, column - 1) : column + 1] = 1.0
    return out


def ladder(linear: RgbPicture, peak: float) -> RgbPicture:
    """Three exposures as R'G'B', each at half size: as in SDR, and two down to `peak`.

    The last shows the peak as white, so that all highlights can be distinguished.
    """
    height, width = linear.shape[:2]
    size = (max(2, width // 2), max(2, height // 2))
    small = np.asarray(cv2.resize(linear, size, interpolation=cv2.INTER_AREA), np.float32)
    stops = float(np.log2(max(peak, 1.0)))
    shown = [
        labelled(encoded(small * np.float32(2.0**-down)), [f"{-down or 0:+.1f} stops", "..."])
        for down in (0.0, stops / 2, stops)
    ]
    return np.concatenate(shown, axis=1)


@functools.lru_cache(maxsize=8)
def _tone_table(name: str, peak: float) -> Float32:
    """Output over input level for all bit patterns of a half float."""
    level = np.nan_to_num(np.abs(all_halves()), nan=0.0, posinf=65504.0).astype(np.float32)
    level = np.maximum(level, np.float32(1e-7))
    return np.asarray(np.minimum(TONE_MAPS[name](level, peak), 1) / level, np.float32)
