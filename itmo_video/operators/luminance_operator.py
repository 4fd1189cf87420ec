"""Operators that are a luminance curve weighted by a map, which includes all published ones."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from itmo_video.colour.luminance import limited_luminance
from itmo_video.model import Float32
from itmo_video.operators.base import GRAIN, Context, Curve, Gain, Guard, Parameter
from itmo_video.operators.protocol import Sees


@dataclass(frozen=True)
class LuminanceOperator:
    """An operator (protocol.py) defined by its gain for luminance, which all channels get (eq. 3).

    `gain(luminance, context)` takes float32 in [0, 1] and returns a new float32 array of the same
    shape; `curve` is the same as expanded luminance, for any float type: the readable form that
    tests compare the gain with in float64. `make_map(luminance, context)` computes a map, float32
    (H, W) in [0, 1], in place of the Expand Map; where the map is 0 the gain is `base` (1). With
    `channel_maps` it is called with linear R, G and B in turn instead of luminance, and each
    channel is weighted by its own map.
    """

    name: str
    summary: str
    source: str
    gain: Gain
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    uses_map: bool = True
    uses_alpha: bool = False
    uses_l_white: bool = False
    needs_stats: bool = False
    curve: Curve | None = None
    make_map: Callable[[Float32, Context], Float32] | None = None
    base: Callable[[Context], float] | None = None
    guard: Guard = GRAIN
    channel_maps: bool = False
    draws_edges: bool = False
    reach_px: int = 0

    @property
    def sees(self) -> Sees:
        """Luminance, or each channel separately."""
        return "channels" if self.channel_maps else "luminance"

    @property
    def has_paper_map(self) -> bool:
        """Whether its map is the density of lights in luminance."""
        return self.make_map is None and not self.channel_maps

    def map(self, picture: Float32, context: Context) -> Float32:
        """Its own map, or the Expand Map: float32 (H, W)."""
        if self.make_map is not None:
            return self.make_map(np.ascontiguousarray(picture), context)
        return context.expand_map(picture)

    def base_gain(self, context: Context) -> float:
        """The gain where the map is 0."""
        return 1.0 if self.base is None else self.base(context)

    def gains(
        self,
        rgb: Sequence[Float32],
        ratio: Float32 | None,
        maps: Sequence[Float32],
        context: Context,
        strength: float,
    ) -> list[Float32]:
        """One gain for all channels, or one per channel if each has its map."""
        gain = self.gain(limited_luminance(rgb, ratio), context)
        return weighed(gain, maps, self.base_gain(context) if maps else 1, strength)


def weighed(gain: Float32, maps: Sequence[Float32], base: float, strength: float) -> list[Float32]:
    """1 + strength * (base + map * (gain - base) - 1) for each map; `gain` is overwritten.

    Without maps as for a map of 1. A gain of 1 is exact where nothing is to change.
    """
    if not maps and strength == 1:
        return [gain]
    gain -= np.float32(base)
    out = [gain * part for part in maps[1:]]
    if maps:
        gain *= maps[0]
    out.insert(0, gain)
    for part in out:
        if strength != 1:
            part *= np.float32(strength)
        part += np.float32(1 + strength * (base - 1))
    return out
