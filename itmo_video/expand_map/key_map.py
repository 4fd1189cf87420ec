"""A keyframe's own map: the Expand Map of sections 2.2 and 2.3, or an operator's own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from itmo_video.colour import linear_light
from itmo_video.colour.analysis_picture import analysis_size, averaged
from itmo_video.colour.luminance import frame_luminance, frame_rgb_small, luminance_of
from itmo_video.expand_map.density import density_map, density_map_soft, scaled_radius_px
from itmo_video.expand_map.letterbox import find_bars
from itmo_video.expand_map.median_cut import median_cut
from itmo_video.look import Look, context_of
from itmo_video.model import Float32, Float64, Frame
from itmo_video.settings import Settings


def make_key_map(frame: Frame, look: Look) -> Float32:
    """A frame's own map at analysis size, (H, W) in [0, 1], or (H, W, 3), one of each channel.

    The Expand Map of sections 2.2 and 2.3, or the operator's own.
    """
    settings, make_map = look.settings, look.operator.make_map
    width, height = analysis_size(*frame.size, settings.map_width)
    if look.operator.make_map_rgb is not None:
        return _rgb_map(frame, (width, height), look)
    luminance = frame_luminance(frame)
    context = None if make_map is None else context_of(luminance, look)
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
    planes = linear_light.to_rgb_linear(frame, clip=True)
    return np.dstack([map_of(_at_size(plane, width, height)) for plane in planes])


def key_lights(frame: Frame, settings: Settings) -> list[tuple[float, float]]:
    """Where the frame's median-cut lights lie, (x, y) from 0 to 1 across the whole picture.

    They are those of the Expand Map: at analysis size, bars left out.
    """
    width, height = analysis_size(*frame.size, settings.map_width)
    luminance = _at_size(frame_luminance(frame), width, height)
    row_weight, left, top = None, 0, 0
    if settings.projection == "latlong":
        row_weight = np.cos(((np.arange(height) + 0.5) / height - 0.5) * np.pi)
    else:
        edge = find_bars(luminance)
        left, top = edge.left, edge.top
        luminance = luminance[top : height - edge.bottom, left : width - edge.right]
    lights = median_cut(np.ascontiguousarray(luminance), settings.lights, row_weight)
    return [
        ((float(x) + left + 0.5) / width, (float(y) + top + 0.5) / height)
        for x, y in zip(lights.x, lights.y, strict=True)
    ]


def _at_size(plane: Float32, width: int, height: int) -> Float32:
    if plane.shape == (height, width):
        return plane
    return np.clip(averaged(plane, (width, height)), 0, 1)


def _rgb_map(frame: Frame, size: tuple[int, int], look: Look) -> Float32:
    """The map of an operator that makes it from linear RGB at analysis size, bars left out."""
    assert look.operator.make_map_rgb is not None
    context, wraps = context_of(None, look), look.settings.projection == "latlong"
    rgb = frame_rgb_small(frame, size)
    if wraps:
        return look.operator.make_map_rgb(rgb, context, True)
    edge = find_bars(luminance_of([rgb[..., c] for c in range(3)]))
    inner = (
        slice(edge.top, size[1] - edge.bottom),
        slice(edge.left, size[0] - edge.right),
    )
    own = look.operator.make_map_rgb(rgb[inner], context, False)
    key_map = np.zeros((size[1], size[0], own.shape[2]), np.float32)
    key_map[inner] = own
    return key_map


def _density(luminance: Float32, row_weight: Float64 | None, settings: Settings) -> Float32:
    height, width = luminance.shape
    lights = median_cut(luminance, settings.lights, row_weight)
    radius_px = scaled_radius_px(settings.radius, width, height)
    density = density_map_soft if settings.soft_lights else density_map
    wrap_x = row_weight is not None
    return density(lights, (height, width), radius_px, settings.min_lights, wrap_x=wrap_x)
