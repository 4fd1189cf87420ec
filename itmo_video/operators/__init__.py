"""Inverse tone mapping operators as gains: expanded luminance over display luminance.

An operator (protocol.py) computes a map from a keyframe's picture, and gains for a frame with it;
it has no state between frames. Eq. 3 keeps the hue by multiplying all three channels by the same
ratio L_w / L_d, so an operator returns that ratio: it stays finite where L_d is 0, and no division
by zero occurs.
"""

from itmo_video.operators.base import (
    Context,
    FrameStats,
    Parameter,
    frame_stats,
    gain_of,
    geometric_mean,
)
from itmo_video.operators.luminance_operator import LuminanceOperator
from itmo_video.operators.protocol import Operator
from itmo_video.operators.registry import (
    OPERATORS,
    all_operators,
    find_operator,
    resolve_params,
    version_of,
)

__all__ = [
    "OPERATORS",
    "Context",
    "FrameStats",
    "LuminanceOperator",
    "Operator",
    "Parameter",
    "all_operators",
    "find_operator",
    "frame_stats",
    "gain_of",
    "geometric_mean",
    "resolve_params",
    "version_of",
]
