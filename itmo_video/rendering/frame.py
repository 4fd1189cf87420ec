"""From one frame's integer codes to half-float HDR: linear light, map, gain, output primaries."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from itmo_video import reused_memory
from itmo_video.colour import linear_light, primaries
from itmo_video.colour.analysis_picture import analysis_guide
from itmo_video.colour.luminance import frame_luminance, limited_luminance, luminance_of
from itmo_video.colour.strips import strip_buffers, strips, with_reach
from itmo_video.kernels import compiled
from itmo_video.kernels.dispatch import with_compiled_form
from itmo_video.look import Look, context_of
from itmo_video.model import Float32, Float64, Frame, Half
from itmo_video.operators import LuminanceOperator
from itmo_video.operators.luminance_operator import weighed
from itmo_video.operators.protocol import WritesHalves
from itmo_video.rendering.guidance import Guidance
from itmo_video.rendering.rows import expand_rows

HALF_MAX = 65504.0
_LEAST_FOR_CV2 = 64  # cv2 takes arrays of up to four elements for scalars


@dataclass(frozen=True)
class Rendered:
    """A finished frame: planar half-float RGB, alpha if any, and the requested layers."""

    rgb: tuple[Half, Half, Half]
    alpha: Half | None
    layers: Mapping[str, Half]


def render(
    frame: Frame, map_small: Float32 | None, look: Look, guide: Float32 | None = None
) -> Rendered:
    """Expand one frame; `map_small` is its map at analysis size, None for a map of 1 everywhere.

    A map (H, W, 3) weights each channel separately; layers then hold their mean by eq. 1.
    `guide` is its `analysis_guide`, made here if None.

    The result is LDR + map * (expanded - LDR), computed as a gain on linear RGB, which preserves
    the hue (eq. 3); in the output primaries, in units of SDR white, within half float's range.
    """
    settings = look.settings
    clip = settings.over_white == "clip"
    width, height = frame.size
    operator = look.operator
    whole = settings.alpha is not None or operator.needs_stats
    context = context_of(frame_luminance(frame) if whole else None, look)
    matrix = None
    if settings.primaries != frame.encoding.primaries:
        matrix = primaries.rgb_to_rgb_matrix(frame.encoding.primaries, settings.primaries)
    if guide is None:
        guide = analysis_guide(frame, settings.map_width)
    guidance = Guidance(
        frame,
        guide,
        settings,
        map_small if look.needs_map else None,
        settings.edge_aware and not operator.draws_edges,
        operator.guard,
    )
    # A gain of L'max on a pixel of a single primary may exceed the range of a half.
    limit = settings.alpha is not None or not clip or 20 * context.l_max > HALF_MAX
    alpha = alpha_of(frame)
    out = reused_memory.empty((3, height, width), np.float16)  # in one piece, of large pages
    layers = {f"{name}.Y": np.empty((height, width), np.float16) for name in settings.layers}
    part, more = min(settings.strength, 1.0), max(settings.strength - 1, 0.0)
    is_plain = not (limit or layers or more) and alpha is None and matrix is None
    if is_plain and isinstance(operator, WritesHalves):
        expand_rows(frame, slice(0, height), guidance, operator, context, part, out)
        return Rendered((out[0], out[1], out[2]), None, {})
    for rows in strips(height):
        wide, within = with_reach(rows, operator.reach_px, height)
        around = strip_buffers(wide, width)
        linear_light.strip_to_rgb_linear(frame, wide, clip, around)
        maps, denoise = guidance.rows(wide)
        rgb = [plane[within] for plane in around]
        if is_plain and isinstance(operator, LuminanceOperator) and len(maps) == 1:
            # The same as below, compiled into one pass over the strip.
            gain = operator.gain(limited_luminance(rgb, denoise), context)
            base = operator.base_gain(context)
            expand(rgb, gain, maps[0], base, part, out[:, rows])
            continue
        gains = [g[within] for g in operator.gains(around, denoise, maps, context, part)]
        maps = [plane[within] for plane in maps]
        if more:
            gains = strengthened(gains, _greatest(rgb), 1 + more, context.l_max)
        _fill_layers(layers, rows, rgb, gains, maps)
        if alpha is not None:
            gains = [part * alpha[rows] for part in gains]
        _write_strip(rgb, gains, matrix, limit, out[:, rows])
    half_alpha = None if alpha is None else alpha.astype(np.float16)
    return Rendered((out[0], out[1], out[2]), half_alpha, layers)


def strengthened(
    gains: Sequence[Float32], greatest: Float32, strength: float, l_max: float
) -> list[Float32]:
    """Gains to the power of a strength of 1 to 2, with a soft knee below the peak: new arrays.

    `greatest` is the highest channel before the gains. The additional gain is compressed into the
    stops left below L'max, equally for all channels: hues stay and nothing exceeds the peak.
    """
    least = np.float32(1e-4)
    stops = [np.log2(np.maximum(gain, least)) for gain in gains]
    most = stops[0]
    for part in stops[1:]:
        most = np.maximum(most, part)
    most = np.maximum(most, 0)
    room = np.maximum(np.log2(l_max / np.maximum(greatest, least)) - most, np.float32(1e-3))
    added = room * (1 - np.exp(most * np.float32(1 - strength) / room))
    factor = 1 + added / np.maximum(most, least)
    return [
        np.asarray(np.exp2(np.where(part > 0, part * factor, part)), np.float32) for part in stops
    ]


def _mean_of(parts: Sequence[Float32]) -> Float32:
    """A single plane unchanged, or the mean of those of R, G and B by eq. 1."""
    return parts[0] if len(parts) == 1 else luminance_of(parts)


def _fill_layers(
    layers: Mapping[str, Half],
    rows: slice,
    rgb: Sequence[Float32],
    gains: Sequence[Float32],
    maps: Sequence[Float32],
) -> None:
    if "expand_map.Y" in layers:
        layers["expand_map.Y"][rows] = _mean_of(maps) if maps else 1
    if "gain.Y" in layers:
        layers["gain.Y"][rows] = _mean_of(gains)
    if "clip_mask.Y" in layers:
        layers["clip_mask.Y"][rows] = _greatest(rgb) >= np.float32(1 - 1e-6)


def _greatest(rgb: Sequence[Float32]) -> Float32:
    return np.maximum(np.maximum(rgb[0], rgb[1]), rgb[2])


def _write_strip(
    rgb: Sequence[Float32],
    gains: Sequence[Float32],
    matrix: Float64 | None,
    limit: bool,
    out: Half,
) -> None:
    each = gains if len(gains) == len(rgb) else [gains[0]] * len(rgb)
    if matrix is None and not limit and gains[0].size >= _LEAST_FOR_CV2:
        for plane, gain, target in zip(rgb, each, out, strict=True):
            cv2.multiply(plane, gain, dst=target, dtype=cv2.CV_16F)
        return
    expanded = [plane * gain for plane, gain in zip(rgb, each, strict=True)]
    if matrix is not None:
        rows = matrix.astype(np.float32)
        expanded = [
            row[0] * expanded[0] + row[1] * expanded[1] + row[2] * expanded[2] for row in rows
        ]
    for plane, target in zip(expanded, out, strict=True):
        target[...] = np.clip(plane, -HALF_MAX, HALF_MAX)


@with_compiled_form(compiled.expand)
def expand(
    rgb: Sequence[Float32],
    gain: Float32,
    weight: Float32,
    base: float,
    strength: float,
    out: Half,
) -> None:
    """Planes times 1 + strength * (base + weight * (gain - base) - 1) as halves into `out`.

    All planes are of one shape; `gain` may be overwritten.
    """
    _write_strip(rgb, weighed(gain, [weight], base, strength), None, False, out)


def alpha_of(frame: Frame) -> Float32 | None:
    """Alpha in [0, 1]; integer sources have unassociated alpha, so RGB is multiplied by it."""
    if not frame.encoding.has_alpha:
        return None
    top = np.float32(2**frame.encoding.bit_depth - 1)
    return np.asarray(np.minimum(frame.planes[-1] / top, 1), np.float32)
