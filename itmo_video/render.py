"""From one frame's integer codes to half-float HDR: linear light, map, gain, output primaries."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from itmo_video import colour, expand_map
from itmo_video.bars import find_bars
from itmo_video.guide import (
    FullMap,
    NoiseGuard,
    analysis_guide,
    analysis_size,
    averaged,
    strip_codes,
)
from itmo_video.median_cut import median_cut
from itmo_video.model import Float32, Float64, Frame, Half
from itmo_video.operators import (
    LUMINANCE_WEIGHTS,
    Context,
    Operator,
    find_operator,
    frame_stats,
    geometric_mean,
    resolve_params,
)
from itmo_video.settings import Settings

STRIP_ROWS = 64  # planes stay near the cache; with fewer, threads wait for each other's GIL
HALF_MAX = 65504.0
_LEAST_FOR_CV2 = 64  # cv2 takes arrays of up to four elements for scalars


@dataclass(frozen=True)
class Look:
    """Settings compiled for rendering: the operator with its parameters."""

    settings: Settings
    operator: Operator
    params: Mapping[str, float]

    @property
    def needs_map(self) -> bool:
        """Whether the Expand Map weighs the result."""
        return self.settings.expand_map and self.operator.uses_map


@dataclass(frozen=True)
class Rendered:
    """A finished frame: planar half-float RGB, alpha if any, and the layers that were asked for."""

    rgb: tuple[Half, Half, Half]
    alpha: Half | None
    layers: Mapping[str, Half]


def make_look(settings: Settings) -> Look:
    """Compile settings; raises UsageError for an unknown operator or parameter."""
    operator = find_operator(settings)
    return Look(settings, operator, resolve_params(operator, settings.operator_params))


def strips(height: int) -> Iterator[slice]:
    """Rows of a frame, STRIP_ROWS at a time."""
    for top in range(0, height, STRIP_ROWS):
        yield slice(top, min(top + STRIP_ROWS, height))


def luminance_of(rgb: Sequence[Float32], out: Float32 | None = None) -> Float32:
    """Eq. 1, of the source's own RGB: float32 of the planes' shape."""
    r, g, b = LUMINANCE_WEIGHTS
    total = np.multiply(rgb[0], np.float32(r), out=out)
    total += rgb[1] * np.float32(g)
    total += rgb[2] * np.float32(b)
    return total


def frame_luminance(frame: Frame) -> Float32:
    """Linear luminance of a whole frame, (H, W) float32 in [0, 1]."""
    width, height = frame.size
    luminance = np.empty((height, width), np.float32)
    for rows in strips(height):
        rgb = _buffers(rows, width)
        colour.strip_to_rgb_linear(frame, rows, True, rgb)
        luminance_of(rgb, luminance[rows])
    return np.clip(luminance, 0, 1, out=luminance)


def make_key_map(frame: Frame, look: Look) -> Float32:
    """A frame's own map at analysis size, (H, W) in [0, 1], or (H, W, 3), one of each channel.

    The Expand Map of sections 2.2 and 2.3, or the operator's own.
    """
    settings, make_map = look.settings, look.operator.make_map
    width, height = analysis_size(*frame.size, settings.map_width)
    if look.operator.make_map_rgb is not None:
        return _rgb_map(frame, (width, height), look)
    luminance = frame_luminance(frame)
    context = None if make_map is None else _context(luminance, look)
    luminance = _at_size(luminance, width, height)
    row_weight, inner = None, (slice(0, height), slice(0, width))
    if settings.projection == "latlong":
        row_weight = np.cos(((np.arange(height) + 0.5) / height - 0.5) * np.pi)
    else:
        edge = find_bars(luminance)
        inner = (slice(edge.top, height - edge.bottom), slice(edge.left, width - edge.right))

    def density(picture: Float32) -> Float32:
        return _density(picture, row_weight, settings)

    def map_of(picture: Float32) -> Float32:
        key_map = np.zeros((height, width), np.float32)
        if make_map is not None and context is not None:
            own = replace(context, density=density)
            key_map[inner] = make_map(np.ascontiguousarray(picture[inner]), own)
        else:
            key_map[inner] = density(picture[inner])
        return key_map

    if not look.operator.channel_maps:
        return map_of(luminance)
    planes = colour.to_rgb_linear(frame, clip=True)
    return np.dstack([map_of(_at_size(plane, width, height)) for plane in planes])


def _at_size(plane: Float32, width: int, height: int) -> Float32:
    if plane.shape == (height, width):
        return plane
    return np.clip(averaged(plane, (width, height)), 0, 1)


def _rgb_map(frame: Frame, size: tuple[int, int], look: Look) -> Float32:
    """The map of an operator that makes it from linear RGB at analysis size, bars left out."""
    assert look.operator.make_map_rgb is not None
    context, wraps = _context(None, look), look.settings.projection == "latlong"
    rgb = frame_rgb_small(frame, size)
    if wraps:
        return look.operator.make_map_rgb(rgb, context, True)
    edge = find_bars(luminance_of([rgb[..., c] for c in range(3)]))
    inner = (
        slice(edge.top, size[1] - edge.bottom),
        slice(edge.left, size[0] - edge.right),
    )
    key_map = np.zeros((size[1], size[0], 3), np.float32)
    key_map[inner] = look.operator.make_map_rgb(rgb[inner], context, False)
    return key_map


def frame_rgb_small(frame: Frame, size: tuple[int, int]) -> Float32:
    """Linear RGB of a frame, area-averaged to (width, height): float32 (H, W, 3) in [0, 1]."""
    width, height = frame.size
    planes = [np.empty((height, width), np.float32) for _ in range(3)]
    for rows in strips(height):
        r, g, b = (plane[rows] for plane in planes)
        colour.strip_to_rgb_linear(frame, rows, True, (r, g, b))
    if size != frame.size:
        planes = [averaged(plane, size) for plane in planes]
    small = np.stack(planes, axis=-1)
    return np.clip(small, 0, 1, out=small)


def _context(luminance: Float32 | None, look: Look) -> Context:
    """What the look's operator may know of a frame; its luminance only where it is asked for."""
    settings, stats, mean = look.settings, None, None
    if luminance is not None:
        stats = frame_stats(luminance) if look.operator.needs_stats else None
        mean = geometric_mean(luminance) if settings.alpha is not None else None
    return Context(
        settings.l_max_effective,
        settings.l_white_effective,
        look.params,
        settings.alpha,
        mean,
        stats,
    )


def _density(luminance: Float32, row_weight: Float64 | None, settings: Settings) -> Float32:
    height, width = luminance.shape
    lights = median_cut(luminance, settings.lights, row_weight)
    radius_px = expand_map.scaled_radius_px(settings.radius, width, height)
    density = expand_map.density_map_soft if settings.soft_lights else expand_map.density_map
    wrap_x = row_weight is not None
    return density(lights, (height, width), radius_px, settings.min_lights, wrap_x=wrap_x)


def render(
    frame: Frame, map_small: Float32 | None, look: Look, guide: Float32 | None = None
) -> Rendered:
    """Expand one frame; `map_small` is its map at analysis size, None for a map of 1 everywhere.

    A map (H, W, 3) weighs each channel by its own; layers then hold eq. 1's mean of the three.
    `guide` is its `guide.analysis_guide`, where that is at hand.

    The result is LDR + map * (expanded - LDR), written as a gain on linear RGB so that the hue is
    kept (eq. 3), in the output primaries, in units of SDR white, within half float's range.
    """
    settings = look.settings
    clip = settings.over_white == "clip"
    width, height = frame.size
    whole = settings.alpha is not None or look.operator.needs_stats
    context = _context(frame_luminance(frame) if whole else None, look)
    base = np.float32(1 if look.operator.base is None else look.operator.base(context))
    matrix = None
    if settings.primaries != frame.encoding.primaries:
        matrix = colour.rgb_to_rgb_matrix(frame.encoding.primaries, settings.primaries)
    if guide is None:
        guide = analysis_guide(frame, settings.map_width)
    gain_channel = look.operator.gain_channel
    edge_aware = settings.edge_aware and gain_channel is None
    weights = None
    if map_small is not None and look.needs_map:
        weights = FullMap(map_small, frame, guide, settings, edge_aware)
    guard = NoiseGuard(frame, guide) if settings.noise_guard else None
    needs_codes = guard is not None or (weights is not None and edge_aware)
    wrap_x = settings.projection == "latlong"
    # A gain of L'max on a pixel of one pure primary may pass what a half can hold.
    limit = settings.alpha is not None or not clip or 20 * context.l_max > HALF_MAX
    alpha = _alpha(frame)
    out = np.empty((3, height, width), np.float16)  # at once: NumPy asks for huge pages
    layers = {f"{name}.Y": np.empty((height, width), np.float16) for name in settings.layers}
    for rows in strips(height):
        rgb = _buffers(rows, width)
        colour.strip_to_rgb_linear(frame, rows, clip, rgb)
        codes, soft = strip_codes(frame, rows, wrap_x) if needs_codes else (None, None)
        denoise = None if guard is None or codes is None else guard.ratio(rows, codes)
        maps = [] if weights is None else weights.rows(rows, soft)
        if gain_channel is not None:
            each: Sequence[Float32 | None] = maps or [None] * len(rgb)
            gains = [
                gain_channel(_drive(plane, denoise, np.empty_like(plane)), part, context)
                for plane, part in zip(rgb, each, strict=True)
            ]
        else:
            luminance = luminance_of(rgb)
            gain = look.operator.gain(_drive(luminance, denoise, luminance), context)
            gains = _weighed(gain, maps, base)
        if settings.strength != 1:
            share = np.float32(settings.strength)
            gains = [(part - np.float32(1)) * share + np.float32(1) for part in gains]
        _fill_layers(layers, rows, rgb, gains, maps)
        if alpha is not None:
            gains = [part * alpha[rows] for part in gains]
        _write_strip(rgb, gains, matrix, limit, out[:, rows])
    half_alpha = None if alpha is None else alpha.astype(np.float16)
    return Rendered((out[0], out[1], out[2]), half_alpha, layers)


def _drive(light: Float32, denoise: Float32 | None, out: Float32) -> Float32:
    """What a gain is found from: luminance or a channel, denoised if so wished, in [0, 1]."""
    if denoise is not None:
        light = np.multiply(light, denoise, out=out)
    return np.clip(light, 0, 1, out=out)


def _buffers(rows: slice, width: int) -> tuple[Float32, Float32, Float32]:
    shape = (rows.stop - rows.start, width)
    return np.empty(shape, np.float32), np.empty(shape, np.float32), np.empty(shape, np.float32)


def _weighed(gain: Float32, maps: Sequence[Float32], base: np.float32) -> list[Float32]:
    """For each map base + map * (gain - base), or the gain as it is; `gain` is overwritten."""
    if not maps:
        return [gain]
    gain -= base
    weighed = [gain * part for part in maps[1:]]
    gain *= maps[0]
    weighed.insert(0, gain)
    for part in weighed:
        part += base
    return weighed


def _mean_of(parts: Sequence[Float32]) -> Float32:
    """One plane as it is; of three, those of R, G and B, the mean by eq. 1."""
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


def _alpha(frame: Frame) -> Float32 | None:
    """Alpha in [0, 1]; integer sources have it unassociated, so RGB is multiplied by it."""
    if not frame.encoding.has_alpha:
        return None
    top = np.float32(2**frame.encoding.bit_depth - 1)
    return np.asarray(np.minimum(frame.planes[-1] / top, 1), np.float32)
