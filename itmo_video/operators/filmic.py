"""Hable's filmic curve, inverted.

The curve and its constants are from memory of the article.
"""

from __future__ import annotations

import numpy as np

from itmo_video.operators.base import Context, Floats, Parameter, gain_of
from itmo_video.operators.luminance_operator import LuminanceOperator

A, B, C, D, E, F = 0.15, 0.50, 0.10, 0.20, 0.02, 0.30  # of Hable's article


def forward(world: Floats, white: float) -> Floats:
    """Display luminance f(x) / f(W), f(x) = (x (A x + C B) + D E) / (x (A x + B) + D F) - E / F."""
    return _shoulder(world) / float(_shoulder(np.float64(white)))


def _shoulder(x: Floats | np.float64) -> Floats:
    return np.asarray((x * (A * x + C * B) + D * E) / (x * (A * x + B) + D * F) - E / F)


def curve_filmic(luminance: Floats, context: Context) -> Floats:
    """The inverse of `forward`, the root x of a quadratic, times L'max / W.

    (A - y A) x^2 + (C B - y B) x + D E - y D F = 0 with y = L_d f(W) + E / F.
    """
    white = context.params["white"]
    shown = luminance * float(_shoulder(np.float64(white)))
    y = shown + E / F
    a, b, c = A * (1 - y), B * (C - y), D * F * shown  # c with its sign flipped
    root = np.sqrt(b * b + 4 * a * c)
    # The form of the root that avoids cancellation.
    x = np.where(b > 0, 2 * c / (np.abs(b) + root), (root - b) / (2 * a))
    return np.asarray(x * (context.l_max / white))


OPERATORS = (
    LuminanceOperator(
        "filmic",
        "inverse of Hable's filmic curve, with toe and shoulder",
        "Hable, Filmic tonemapping operators, filmicworlds.com 2010 (Uncharted 2, GDC 2010)",
        gain_of(curve_filmic),
        {"white": Parameter(11.2, 1.0, 100.0, "W, the luminance that the curve maps to white")},
        curve=curve_filmic,
    ),
)
