"""From one frame's integer codes to half-float HDR: linear light, map, gain, output primaries."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np

from itmo_video import colour, expand_map
from itmo_video.median_cut import median_cut
from itmo_video.model import Code, Float32, Float64, Frame, Half
from itmo_video.operators import (
    LUMINANCE_WEIGHTS,
    Context,
    Operator,
    find_operator,
    geometric_mean,
    resolve_params,
)
from itmo_video.settings import Settings

STRIP_ROWS = 40  # so that a strip's planes stay in the L2 cache
EDGE_EPSILON = 1e-3  # guided filter: contrasts (squared, of codes 0..1) below this are smoothed
HALF_MAX = 65504.0


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


def analysis_size(width: int, height: int, map_width: int) -> tuple[int, int]:
    """(width, height) of the picture that map and flow are made at: at most `map_width` wide."""
    if width <= map_width:
        return width, height
    return map_width, max(1, round(height * map_width / width))


def guide_codes(frame: Frame, size: tuple[int, int] | None = None) -> Float32:
    """Luma code, 0 black to 1 white, unclipped: float32 (H, W), area-averaged to `size`."""
    encoding = frame.encoding
    top = float(2**encoding.bit_depth - 1)
    black, span = 0.0, top
    if encoding.range == "limited" and encoding.family != "rgb":
        step = 2.0 ** (encoding.bit_depth - 8)
        black, span = 16 * step, 219 * step
    count = 3 if encoding.family == "rgb" else 1
    weights = LUMINANCE_WEIGHTS if count == 3 else (1.0,)
    total: Float32 | None = None
    for plane, weight in zip(frame.planes[0:count], weights, strict=True):
        if size is not None and (plane.shape[1], plane.shape[0]) != size:
            plane = cv2.resize(plane, size, interpolation=cv2.INTER_AREA)
        part = cv2.addWeighted(
            plane, weight / span, plane, 0, -black * weight / span, dtype=cv2.CV_32F
        )
        total = part if total is None else cv2.add(total, part)
    assert total is not None
    return np.asarray(total, np.float32).reshape(total.shape[:2])


def analysis_grey(frame: Frame, map_width: int) -> Code:
    """8-bit grey picture at analysis size, for cuts, flow and as the map's guide."""
    codes = guide_codes(frame, analysis_size(*frame.size, map_width))
    return np.asarray(cv2.convertScaleAbs(cv2.max(codes, 0.0), alpha=255))


def luminance_of(rgb: tuple[Float32, Float32, Float32]) -> Float32:
    """Eq. 1, with the source's own RGB: float32 of the planes' shape."""
    r, g, b = LUMINANCE_WEIGHTS
    total = cv2.addWeighted(rgb[0], r, rgb[1], g, 0)
    return np.asarray(cv2.scaleAdd(rgb[2], b, total), np.float32).reshape(rgb[0].shape)


def make_key_map(frame: Frame, look: Look) -> Float32:
    """A frame's own Expand Map at analysis size (sections 2.2 and 2.3), (H, W) in [0, 1]."""
    settings = look.settings
    size = analysis_size(*frame.size, settings.map_width)
    luminance = luminance_of(colour.to_rgb_linear(frame, clip=True))
    if (luminance.shape[1], luminance.shape[0]) != size:
        luminance = np.asarray(cv2.resize(luminance, size, interpolation=cv2.INTER_AREA))
    luminance = np.clip(luminance, 0, 1)
    width, height = size
    latlong = settings.projection == "latlong"
    row_weight = None
    if latlong:
        row_weight = np.cos(((np.arange(height) + 0.5) / height - 0.5) * np.pi)
    lights = median_cut(luminance, settings.lights, row_weight)
    radius_px = expand_map.scaled_radius_px(settings.radius, width, height)
    density = expand_map.density_map_soft if settings.soft_lights else expand_map.density_map
    return density(lights, (height, width), radius_px, settings.min_lights, wrap_x=latlong)


def full_size_map(map_small: Float32, frame: Frame, look: Look) -> Float32:
    """The map brought up to the frame's size: bilinear, or along the picture's edges."""
    settings = look.settings
    width, height = frame.size
    if not settings.edge_aware:
        return expand_map.upsample_bilinear(map_small, (height, width))
    small_h, small_w = map_small.shape
    guide_small = guide_codes(frame, (small_w, small_h))
    radius = max(1, round(expand_map.scaled_radius_px(settings.radius, small_w, small_h)))
    a, b = expand_map.edge_aware_coefficients(map_small, guide_small, radius, EDGE_EPSILON)
    a_full = expand_map.upsample_bilinear(a, (height, width))
    b_full = expand_map.upsample_bilinear(b, (height, width))
    full = cv2.multiply(a_full, guide_codes(frame), dst=a_full)
    full = cv2.add(full, b_full, dst=full)
    return np.asarray(cv2.min(cv2.max(full, 0.0), 1.0), np.float32).reshape(height, width)


def render(frame: Frame, map_small: Float32 | None, look: Look) -> Rendered:
    """Expand one frame; `map_small` is its map at analysis size, None for a map of 1 everywhere.

    The result is LDR + map * (expanded - LDR), written as a gain on linear RGB so that the hue is
    kept (eq. 3), in the output primaries, in units of SDR white, within half float's range.
    """
    settings = look.settings
    keep = settings.over_white == "keep"
    rgb = colour.to_rgb_linear(frame, clip=not keep)
    luminance = luminance_of(rgb)
    luminance = np.clip(luminance, 0, 1)
    context = Context(
        look.settings.l_max_effective,
        look.settings.l_white_effective,
        look.params,
        settings.alpha,
        geometric_mean(luminance) if settings.alpha is not None else None,
    )
    weight = None
    if map_small is not None and look.needs_map:
        weight = full_size_map(map_small, frame, look)
    matrix = None
    if settings.primaries != frame.encoding.primaries:
        matrix = colour.rgb_to_rgb_matrix(frame.encoding.primaries, settings.primaries)
    shape = (frame.size[1], frame.size[0])
    out = [np.empty(shape, np.float16) for _ in range(3)]
    gain_full = np.empty(shape, np.float32) if "gain" in settings.layers else None
    for top in range(0, shape[0], STRIP_ROWS):
        rows = slice(top, top + STRIP_ROWS)
        gain = look.operator.gain(luminance[rows], context)
        if weight is not None:
            gain -= np.float32(1)
            gain *= weight[rows]
            gain += np.float32(1)
        if settings.strength != 1:
            gain = (gain - np.float32(1)) * np.float32(settings.strength) + np.float32(1)
        if gain_full is not None:
            gain_full[rows] = gain
        _write_strip([plane[rows] for plane in rgb], gain, matrix, [plane[rows] for plane in out])
    alpha = _alpha(frame)
    if alpha is not None:
        out = [(plane.astype(np.float32) * alpha).astype(np.float16) for plane in out]
    layers: dict[str, Half] = {}
    if "expand_map" in settings.layers:
        layers["expand_map.Y"] = (np.ones(shape, np.float32) if weight is None else weight).astype(
            np.float16
        )
    if "clip_mask" in settings.layers:
        peak = np.maximum(np.maximum(rgb[0], rgb[1]), rgb[2])
        layers["clip_mask.Y"] = (peak >= np.float32(1 - 1e-6)).astype(np.float16)
    if gain_full is not None:
        layers["gain.Y"] = gain_full.astype(np.float16)
    return Rendered(
        (out[0], out[1], out[2]), None if alpha is None else alpha.astype(np.float16), layers
    )


def _write_strip(
    rgb: list[Float32], gain: Float32, matrix: Float64 | None, out: list[Half]
) -> None:
    expanded = [cv2.multiply(plane, gain) for plane in rgb]
    if matrix is not None:
        mixed = []
        for row in matrix.tolist():
            part = cv2.addWeighted(expanded[0], row[0], expanded[1], row[1], 0)
            mixed.append(cv2.scaleAdd(expanded[2], row[2], part))
        expanded = mixed
    for plane, target in zip(expanded, out, strict=True):
        # Above 65504 a half would be infinite (facts.md).
        limited = cv2.min(cv2.max(plane, -HALF_MAX), HALF_MAX)
        target[...] = cv2.multiply(limited, 1.0, dtype=cv2.CV_16F).reshape(target.shape)


def _alpha(frame: Frame) -> Float32 | None:
    """Alpha in [0, 1]; integer sources have it unassociated, so RGB is multiplied by it."""
    if not frame.encoding.has_alpha:
        return None
    top = np.float32(2**frame.encoding.bit_depth - 1)
    return np.asarray(np.minimum(frame.planes[-1] / top, 1), np.float32)
