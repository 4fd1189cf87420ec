"""The paper's operator, and the simpler inverse that it improves (Banterle et al. 2006).

Implemented from the paper itself.
"""

from __future__ import annotations

import cv2
import numpy as np

from itmo_video.kernels import compiled
from itmo_video.kernels.dispatch import with_compiled_form
from itmo_video.model import Float32
from itmo_video.operators.base import Context, Floats
from itmo_video.operators.luminance_operator import LuminanceOperator

_PAPER = "Banterle, Ledda, Debattista and Chalmers, Inverse Tone Mapping, GRAPHITE 2006"


def curve_banterle2006(luminance: Floats, context: Context) -> Floats:
    """Eq. 11's positive root, with alpha from eq. 13 unless the user gave one.

    With eq. 13 the geometric mean cancels: L_w(1) = L'max and the slope at 0 is L'max / L_white.
    A given alpha means L'max = L_white * mean / alpha (eq. 12).
    """
    scale = context.scale
    l_max = context.l_max if scale is None else context.l_white * scale
    discriminant = (1 - luminance) ** 2 + 4 / context.l_white**2 * luminance
    return l_max * context.l_white / 2 * (luminance - 1 + np.sqrt(discriminant))


def gain_banterle2006(luminance: Float32, context: Context) -> Float32:
    """`curve_banterle2006` over L_d, as 2 L_d / ((1 - L_d) + sqrt(D)).

    This form avoids cancellation in float32 for dark pixels.
    """
    scale = context.scale
    l_max = context.l_max if scale is None else context.l_white * scale
    slope, factor = 4.0 / context.l_white**2, 2.0 * l_max / context.l_white
    return _gain_banterle2006(luminance, slope, factor)


@with_compiled_form(compiled.gain_banterle2006)
def _gain_banterle2006(luminance: Float32, slope: float, factor: float) -> Float32:
    rest = np.float32(1) - luminance
    root = rest * rest
    root += np.float32(slope) * luminance
    cv2.sqrt(root, dst=root)
    root += rest
    np.divide(np.float32(factor), root, out=root)
    return root


def curve_reinhard2002(luminance: Floats, context: Context) -> Floats:
    """Eq. 9 with damping: scale * L_d / (1 - L_d + damping), which keeps white finite.

    The paper mentions "a damping factor" but gives none; ours makes L_w(1) = L'max exactly.
    Without alpha the scale L_mean / alpha is 1, so dark tones keep their luminance.
    """
    scale = context.scale if context.scale is not None else 1.0
    return scale * luminance / (1 - luminance + scale / context.l_max)


def gain_reinhard2002(luminance: Float32, context: Context) -> Float32:
    """`curve_reinhard2002` over L_d."""
    scale = context.scale if context.scale is not None else 1.0
    damping = np.float32(scale / context.l_max)
    return np.asarray(np.float32(scale) / (np.float32(1) - luminance + damping), np.float32)


OPERATORS = (
    LuminanceOperator(
        "banterle2006",
        "inverse of the global photographic operator, with white point",
        f"{_PAPER}, eq. 11 and 13",
        gain_banterle2006,
        uses_alpha=True,
        uses_l_white=True,
        curve=curve_banterle2006,
    ),
    LuminanceOperator(
        "reinhard2002",
        "inverse of the global photographic operator without white point, damped",
        f"{_PAPER}, eq. 9",
        gain_reinhard2002,
        uses_alpha=True,
        curve=curve_reinhard2002,
    ),
)
