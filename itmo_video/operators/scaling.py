"""Scaling and exponential expansion: the naive operators that the paper compares with."""

from __future__ import annotations

import numpy as np

from itmo_video.model import Float32
from itmo_video.operators.base import Context, Floats, Parameter
from itmo_video.operators.luminance_operator import LuminanceOperator


def gain_landis2002(luminance: Float32, context: Context) -> Float32:
    """The naive operator: exponential expansion above a threshold, up to L'max (Landis 2002).

    The course notes give no formula; ours is L_d * L'max^t with t from 0 at the threshold to 1 at
    white, continuous, and exactly L_d below.
    """
    threshold = context.params["threshold"]
    t = np.clip((luminance - threshold) / max(1.0 - threshold, 1e-6), 0, 1)
    return np.asarray(np.exp(t * np.float32(np.log(context.l_max))), np.float32)


def curve_landis2002(luminance: Floats, context: Context) -> Floats:
    """L_d * L'max^t, see `gain_landis2002`."""
    threshold = context.params["threshold"]
    t = np.clip((luminance - threshold) / max(1.0 - threshold, 1e-6), 0, 1)
    return np.asarray(luminance * context.l_max**t)


def gain_linear(luminance: Float32, context: Context) -> Float32:
    """Everything multiplied by L'max."""
    return np.full_like(luminance, context.l_max)


OPERATORS = (
    LuminanceOperator(
        "landis2002",
        "naive: exponential up to the maximum, above a threshold",
        "Landis, Production-ready global illumination, SIGGRAPH 2002 course notes 16",
        gain_landis2002,
        {"threshold": Parameter(0.5, 0.0, 0.999, "luminance above which it expands")},
        curve=curve_landis2002,
    ),
    LuminanceOperator(
        "linear",
        "everything multiplied by the maximum, without a map",
        "for comparison",
        gain_linear,
        uses_map=False,
        curve=lambda luminance, context: context.l_max * luminance,
    ),
)
