"""The operator `auto`: treats each shot by how it was rendered to SDR.

Eq. 11 where highlights were tone-mapped, a network's estimate where they clipped; anything else is
unchanged.

At keyframes, map_auto computes from the analysis picture how far each clipped place lies above
white, for R, G and B separately (auto_levels), and the weight of eq. 11 at each place
(auto_rendering). These are carried along motion like the Expand Map. In every frame (gain_auto)
eq. 11 gives one gain for all channels, so unclipped colours keep their chromaticity; a channel
departs from the others only where it is at white, and pixels beside each other do so alike.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import cv2
import numpy as np

from itmo_video.colour.luminance import greatest_of, luminance_of
from itmo_video.kernels import compiled_auto
from itmo_video.kernels.compiled_light import CodesToLight
from itmo_video.kernels.dispatch import with_compiled_form
from itmo_video.model import Code, Float32, Half
from itmo_video.operators.auto_clipping import known_clipped
from itmo_video.operators.auto_levels import (
    certainty,
    expected_levels,
    level_shares,
    mean_stops,
    where_clipped,
)
from itmo_video.operators.auto_parting import (
    bounded_parting,
    colour_lost,
    colour_of_bright,
    decided_together,
)
from itmo_video.operators.auto_rendering import GREATEST_WEIGHT, curve_weight, rendering_of
from itmo_video.operators.auto_self_test import self_test
from itmo_video.operators.base import Context, Guard, Parameter
from itmo_video.operators.luminance_operator import weighed
from itmo_video.operators.photographic import gain_banterle2006
from itmo_video.operators.protocol import Sees
from itmo_video.operators.ramps import ramp, ramps

# How far a channel counts as clipped, on linear light: fitted with the network's weights.
OPEN_CENTRE, OPEN_SLOPE, OPEN_FROM = 0.808, 27.3, 0.5
_OPEN_LOW, _OPEN_WHITE = (
    1 / (1 + math.exp(-OPEN_SLOPE * (light - OPEN_CENTRE))) for light in (OPEN_FROM, 1.0)
)
APART_FROM, APART_WHOLLY = 0.9, 1.0  # of the highest channel: below, channels do not separate
RATIO_LOW, RATIO_HIGH = 0.7, 2.0  # of smoothed over given light: keeps small lamps bright
WITH_FROM, WITH_WHOLLY = 0.8, 1.0  # light at which a channel counts as clipped with the highest
UNSURE, SURE, LEAST_TRUST = 0.1, 0.27, 0.3  # of the network's stops, where it is uncertain
REACH_PX = 1  # pixels around a pixel that decide how far its channels separate
LEAST_LIGHT = 2e-3
# Eq. 11's argument is smoothed over texture, which is not amplified with the light on it.
TEXTURE = Guard(radius_px=21, epsilon=0.02, curve_map=3)


def map_auto(rgb_linear: Float32, context: Context, wrap_x: bool = False) -> Float32:
    """The four maps of a keyframe: float32 (H, W, 4) in [0, 1].

    The expected log2 of R, G and B of each pixel if clipped, over log2 L'max, and eq. 11's weight
    over GREATEST_WEIGHT. `rgb_linear` is the picture at analysis size, float32 (H, W, 3) in
    [0, 1]; `wrap_x` for a panorama.
    """
    height, width = rgb_linear.shape[:2]
    pad = min(width, max(1, width // 8)) if wrap_x else 0
    wide = _wrapped(rgb_linear, pad)
    known = context.recall("known", lambda: known_clipped(wide))
    seen = context.recall("rendering", lambda: rendering_of(rgb_linear))
    rendering = replace(seen, footage=context.footage)
    inner = slice(pad, pad + width)
    used = np.zeros((height, width, 3), np.float32)
    if cv2.hasNonZero(known.reshape(height, -1)):  # else the network is not asked
        opened, share = _opened(rgb_linear, wide, known, context, wrap_x)
        opened *= np.float32(rendering.caution * share)
        used = opened[:, inner]
    weight = curve_weight(wide, rendering, context.lamps)[:, inner]
    maps = np.empty((height, width, 4), np.float32)
    cv2.mixChannels(
        [used, weight], [maps], [0, 0, 1, 1, 2, 2, 3, 3]
    )  # NumPy takes five times as long
    return maps


def _opened(
    rgb_linear: Float32, wide: Float32, known: Float32, context: Context, wrap_x: bool
) -> tuple[Float32, float]:
    """The network's stops of R, G and B over log2 L'max, and the share of them to be used.

    `wide` is the picture and what was added at its sides, for which stops and `known` are.
    """
    height, width = rgb_linear.shape[:2]
    pad = (wide.shape[1] - width) // 2
    shares = context.recall("shares", lambda: level_shares(rgb_linear, wrap_x))
    levels = expected_levels(shares, (height, width), context.l_max, wrap_x)
    levels = _wrapped(levels, pad)
    peak_stops = math.log2(max(context.l_max, 1 + 1e-6))
    colour = context.recall("colour", lambda: colour_of_bright(wide))
    lost = context.recall("lost", lambda: colour_lost(wide, colour)) * np.float32(1 / peak_stops)
    levels *= known
    apart = bounded_parting(levels, colour, lost, peak_stops)
    opened = decided_together(apart, wide, lost)
    clipped = np.ascontiguousarray(greatest_of(known)[:, pad : pad + width])
    there = context.recall("there", lambda: where_clipped(shares, clipped, wrap_x))
    trusted = LEAST_TRUST + (1 - LEAST_TRUST) * ramp(certainty(there), UNSURE, SURE)
    tested = context.recall("self_test", lambda: self_test(rgb_linear, mean_stops(there), wrap_x))
    return opened, trusted * tested


def _wrapped(planes: Float32, pad: int) -> Float32:
    """Planes (H, W, C) with `pad` columns of the other side added at each side."""
    return np.pad(planes, ((0, 0), (pad, pad), (0, 0)), "wrap") if pad else planes


def _numbers(context: Context) -> compiled_auto.GainAuto:
    return compiled_auto.GainAuto(
        gate=(OPEN_FROM, OPEN_CENTRE, OPEN_SLOPE / math.log(2), _OPEN_LOW, _OPEN_WHITE),
        steep=(APART_FROM, APART_WHOLLY, float(context.hue == "restore")),
        along=(WITH_FROM, WITH_WHOLLY),
        l_max=context.l_max,
    )


def _compiled_gain_auto(
    loaded: ctypes.CDLL,
    rgb: Sequence[Float32],
    ratio: Float32 | None,
    maps: Sequence[Float32],
    context: Context,
) -> list[Float32]:
    return compiled_auto.gain_auto(loaded, rgb, ratio, maps, _numbers(context))


@with_compiled_form(_compiled_gain_auto)
def gain_auto(
    rgb: Sequence[Float32], ratio: Float32 | None, maps: Sequence[Float32], context: Context
) -> list[Float32]:
    """The gains of R, G and B, float32 of their shape: at most L'max, 1 where maps are 0.

    `rgb` is linear light, clipped at 1, (rows, W); `ratio` is smoothed over given luminance, 1 if
    None; `maps` are the four of map_auto, or none: everything that clips then goes to L'max. How
    far a channel separates is averaged over 3 x 3 pixels (REACH_PX), so that none does alone.
    """
    l_max, apart = context.l_max, context.hue == "restore"
    peak_stops = np.float32(math.log2(l_max))
    limited = [np.clip(plane, 0, 1) for plane in rgb]
    greatest = np.maximum(np.maximum(limited[0], limited[1]), limited[2])
    curve: Float32 | np.float32 = np.float32(0)
    if len(maps) == 4:
        even = np.float32(1) if ratio is None else np.clip(ratio, RATIO_LOW, RATIO_HIGH)
        least = np.float32(LEAST_LIGHT)
        light = np.clip((luminance_of(limited) + greatest) * np.float32(0.5) * even, least, 1)
        gain = np.log2(gain_banterle2006(light, Context(l_max, l_max)))
        weight = maps[3] * np.float32(GREATEST_WEIGHT)
        # Beyond eq. 11's own gain, a soft knee below the peak, which texture must not exceed.
        room = np.maximum(peak_stops - np.log2(np.clip(greatest * even, least, 1)) - gain, 0)
        more = np.maximum(weight - 1, 0) * gain
        curve = np.minimum(weight, 1) * gain + room * more / (room + more + np.float32(1e-6))
        curve = np.clip(curve, 0, peak_stops - np.log2(np.maximum(greatest, least)))
    stops = []
    for i, plane in enumerate(limited):
        known = peak_stops * maps[i] if maps else peak_stops
        gate = 1 / (1 + np.exp(np.float32(-OPEN_SLOPE) * (plane - np.float32(OPEN_CENTRE))))
        gate = np.maximum(gate - np.float32(_OPEN_LOW), 0)
        stops.append(np.maximum(known - curve, 0) * gate / np.float32(_OPEN_WHITE - _OPEN_LOW))
    common = np.minimum(np.minimum(stops[0], stops[1]), stops[2])
    open_ = ramps(greatest, APART_FROM, APART_WHOLLY)
    gains = []
    for plane, own in zip(limited, stops, strict=True):
        total = curve + common
        if apart:
            apart_here = ramps(plane, WITH_FROM, WITH_WHOLLY) * open_
            total = total + (own - common) * averaged_over_neighbours(apart_here)
        gains.append(np.asarray(np.exp2(total), np.float32))
    return gains


def averaged_over_neighbours(plane: Float32) -> Float32:
    """The mean of 3 x 3 pixels, weighted 1 2 1 each way; edges repeat: (rows, W)."""
    wide = np.pad(plane, 1, "edge")
    along = (wide[:, :-2] + wide[:, 2:]) * np.float32(0.25) + wide[:, 1:-1] * np.float32(0.5)
    above, here, below = (part * np.float32(w) for part, w in (
        (along[:-2], 0.25), (along[1:-1], 0.5), (along[2:], 0.25)
    ))  # fmt: skip
    return np.asarray(above + here + below, np.float32)


def _compiled_expand_auto(
    loaded: ctypes.CDLL,
    rgb: Sequence[Float32],
    ratio: Float32 | None,
    maps: Sequence[Float32],
    context: Context,
    strength: float,
    out: Half,
) -> None:
    compiled_auto.expand_auto(loaded, rgb, ratio, maps, _numbers(context), strength, out)


@with_compiled_form(_compiled_expand_auto)
def expand_auto(
    rgb: Sequence[Float32],
    ratio: Float32 | None,
    maps: Sequence[Float32],
    context: Context,
    strength: float,
    out: Half,
) -> None:
    """Write the picture times 1 + `strength` * (gain_auto - 1) as halves to `out` (3, rows, W)."""
    gains = gain_auto(rgb, ratio, maps, context)
    for plane, gain, target in zip(rgb, gains, out, strict=True):
        (part,) = weighed(gain, [], 1, strength)
        part *= plane
        target[...] = part


@dataclass(frozen=True)
class AutoOperator:
    """The operator (protocol.py): three maps of clipped highlights and one of eq. 11's weight."""

    name: str = "auto"
    summary: str = (
        "treats each shot by how it was rendered to SDR: eq. 11 if tone-mapped, a neural "
        "network's estimate where highlights clipped"
    )
    source: str = "itmo_video's own: docs/auto.md; eq. 11 of Banterle et al. 2006"
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    uses_map: bool = True
    uses_alpha: bool = False
    uses_l_white: bool = False
    needs_stats: bool = False
    guard: Guard = TEXTURE
    sees: Sees = "rgb"
    draws_edges: bool = True
    has_paper_map: bool = False
    reach_px: int = REACH_PX

    def map(self, picture: Float32, context: Context) -> Float32:
        """`map_auto` of the picture: float32 (H, W, 4) in [0, 1]."""
        return map_auto(picture, context, context.wraps)

    def gains(
        self,
        rgb: Sequence[Float32],
        ratio: Float32 | None,
        maps: Sequence[Float32],
        context: Context,
        strength: float,
    ) -> list[Float32]:
        """`gain_auto` of R, G and B, weighted by the strength."""
        return [
            part
            for gain in gain_auto(rgb, ratio, maps, context)
            for part in weighed(gain, [], 1, strength)
        ]

    def expand(
        self,
        rgb: Sequence[Float32],
        ratio: Float32 | None,
        maps: Sequence[Float32],
        context: Context,
        strength: float,
        out: Half,
    ) -> None:
        """`expand_auto`."""
        expand_auto(rgb, ratio, maps, context, strength, out)

    def from_codes(
        self,
        loaded: ctypes.CDLL,
        planes: Sequence[Code],
        rows: slice,
        codes: CodesToLight,
        maps: compiled_auto.SmallMaps,
        context: Context,
        strength: float,
        out: Half,
    ) -> None:
        """`expand_auto` of codes."""
        compiled_auto.auto_from_codes(
            loaded, planes, rows, codes, maps, _numbers(context), strength, out
        )


OPERATORS = (AutoOperator(),)
