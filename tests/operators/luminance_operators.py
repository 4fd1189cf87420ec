"""Operators on luminance, by name."""

from __future__ import annotations

from itmo_video.operators.luminance_operator import LuminanceOperator
from itmo_video.operators.registry import OPERATORS


def by_luminance(name: str) -> LuminanceOperator:
    operator = OPERATORS[name]
    assert isinstance(operator, LuminanceOperator)
    return operator
