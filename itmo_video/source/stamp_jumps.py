"""Splices in a broadcast stream, found by its stamps."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

BROADCAST = ("mpegts", "mpeg")
_JUMP_S = 10  # stamps further apart than this in a broadcast stream are a splice


class Jumps:
    """Detects jumps backwards or far ahead in the stamps of a broadcast stream, in file order."""

    def __init__(self, stream: Any) -> None:
        name = str(stream.container.format.name)
        self.found = False
        self._last: int | None = None
        self._reach = round(_JUMP_S / Fraction(stream.time_base)) if name in BROADCAST else None

    def see(self, stamp: int | None) -> bool:
        """Whether this stamp jumps relative to the previous one."""
        if stamp is None or self._reach is None:
            return False
        last, self._last = self._last, stamp
        jumps = last is not None and not -self._reach // 10 <= stamp - last <= self._reach
        self.found = self.found or jumps
        return jumps
