"""Primaries, and matrices between them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from itmo_video.model import Float64, Matrix

LUMINANCE_KR_KB: dict[Matrix, tuple[float, float]] = {
    "bt709": (0.2126, 0.0722),  # ITU-R BT.709-6, 3.2
    "bt601": (0.299, 0.114),  # ITU-R BT.601-7, 2.5.1
    "bt2020": (0.2627, 0.0593),  # ITU-R BT.2020-2, table 4, non-constant luminance
}

LUMINANCE_WEIGHTS_BT709 = (0.2126, 0.7152, 0.0722)  # BT.709-6, 3.2: for measurements
LUMINANCE_WEIGHTS_BANTERLE2006 = (0.213, 0.715, 0.072)  # the paper's eq. 1: for operators

_D65 = (0.3127, 0.3290)
_ACES_WHITE = (0.32168, 0.33767)
Chromaticities: TypeAlias = tuple[float, float, float, float, float, float, float, float]
CHROMATICITIES: dict[str, Chromaticities] = {
    "rec709": (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, *_D65),
    "rec601_525": (0.630, 0.340, 0.310, 0.595, 0.155, 0.070, *_D65),
    "rec601_625": (0.64, 0.33, 0.29, 0.60, 0.15, 0.06, *_D65),
    "rec2020": (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, *_D65),
    "p3d65": (0.680, 0.320, 0.265, 0.690, 0.150, 0.060, *_D65),
    "adobergb": (0.64, 0.33, 0.21, 0.71, 0.15, 0.06, *_D65),
    "acescg": (0.713, 0.293, 0.165, 0.830, 0.128, 0.044, *_ACES_WHITE),  # AP1
    "alexa_wide_gamut": (0.684, 0.313, 0.221, 0.848, 0.0861, -0.102, *_D65),
    "aces2065-1": (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, *_ACES_WHITE),  # AP0
}
"""rx, ry, gx, gy, bx, by, wx, wy of each set of primaries, sources' and outputs'."""

INTEROP_IDS: dict[str, str] = {
    "rec709": "lin_rec709_scene",
    "rec2020": "lin_rec2020_scene",
    "acescg": "lin_ap1_scene",
    "aces2065-1": "lin_ap0_scene",
}
"""The Color Interop Forum's name of linear light in these primaries (ASWF, 2025)."""

OCIO_NAMES: dict[str, str] = {
    "rec709": "Linear Rec.709 (sRGB)",
    "rec2020": "Linear Rec.2020",
    "acescg": "ACEScg",
    "aces2065-1": "ACES2065-1",
}
"""The names of linear light in OpenColorIO's ACES configs; interop IDs are aliases."""

_BRADFORD = np.array(
    [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]]
)


def rgb_to_xyz_matrix(primaries: str) -> Float64:
    """3x3 float64 from linear RGB to CIE XYZ with Y = 1 at RGB white (SMPTE RP 177)."""
    x, y = np.array(CHROMATICITIES[primaries]).reshape(4, 2).T
    xyz = np.stack((x / y, np.ones(4), (1 - x - y) / y))
    scale = np.linalg.solve(xyz[:, :3], xyz[:, 3])
    return np.asarray(xyz[:, :3] * scale, np.float64)


def luminance_weights(primaries: str) -> tuple[float, float, float]:
    """The weights of linear R, G and B in luminance for these primaries; they sum to 1."""
    red, green, blue = rgb_to_xyz_matrix(primaries)[1]
    return float(red), float(green), float(blue)


def nearest_primaries(xy: Sequence[float]) -> str:
    """The name in CHROMATICITIES nearest to these rx, ry, gx, gy, bx, by, wx, wy."""
    return min(
        CHROMATICITIES, key=lambda name: float(np.abs(np.subtract(CHROMATICITIES[name], xy)).sum())
    )


def rgb_to_rgb_matrix(source: str, target: str) -> Float64:
    """The 3x3 float64 matrix from linear RGB in one set of primaries to another.

    Names are those of `CHROMATICITIES`. White maps to white: different white points are adapted
    by Bradford's cone responses (Lam 1985). Raises KeyError for an unknown name.
    """
    if source == target:
        return np.eye(3)
    to_xyz, from_xyz = rgb_to_xyz_matrix(source), np.linalg.inv(rgb_to_xyz_matrix(target))
    if CHROMATICITIES[source][6:] == CHROMATICITIES[target][6:]:
        return np.asarray(from_xyz @ to_xyz, np.float64)
    adapt = white_adaptation(white_xyz(source), white_xyz(target))
    return np.asarray(from_xyz @ adapt @ to_xyz, np.float64)


def white_xyz(primaries: str) -> Float64:
    """XYZ of the white point of a set of primaries, Y = 1."""
    x, y = CHROMATICITIES[primaries][6:]
    return np.array([x / y, 1, (1 - x - y) / y])


def white_adaptation(source_xyz: Float64, target_xyz: Float64) -> Float64:
    """3x3 float64 from XYZ under one white to another, by Bradford's cone responses."""
    ratio = (_BRADFORD @ target_xyz) / (_BRADFORD @ source_xyz)
    return np.linalg.solve(_BRADFORD, ratio[:, None] * _BRADFORD)
