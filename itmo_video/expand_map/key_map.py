"""The map of a keyframe: the Expand Map of sections 2.2 and 2.3, or an operator's own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from itmo_video.colour import linear_light
from itmo_video.colour.analysis_picture import analysis_size, averaged
from itmo_video.colour.luminance import frame_luminance, frame_rgb_small, luminance_of_pixels
from itmo_video.expand_map.density import density_map, density_map_soft, scaled_radius_px
from itmo_video.expand_map.letterbox import find_bars
from itmo_video.expand_map.median_cut import median_cut
from itmo_video.look import Look, context_of
from itmo_video.model import Float32, Float64, Frame
from itmo_video.operators.base import Recall, made_anew
from itmo_video.settings import Settings


def make_key_map(frame: Frame, look: Look, recall: Recall = made_anew) -> Float32:
    """A frame's map at analysis size, (H, W) in [0, 1], or (H, W, C) with planes for gains.

    The Expand Map of sections 2.2 and 2.3, or the operator's own; 0 on black bars. `recall` may
    cache what operators compute from the picture alone (`Context.recall`).
    """
    size = analysis_size(*frame.size, look.settings.map_width)
    if look.operator.sees == "rgb":
        return _map_of_rgb(frame, size, look, recall)
    return _map_of_light(frame, size, look)


def _map_of_light(frame: Frame, size: tuple[int, int], look: Look) -> Float32:
    """The map of an operator that takes luminance, or one channel at a time."""
    settings, (width, height) = look.settings, size
    luminance = frame_luminance(frame)
    context = context_of(luminance, look)
    luminance = _at_size(luminance, width, height)
    wraps = settings.projection == "latlong"
    row_weight, inner = _row_weight(height, wraps), _inner(luminance, wraps)

    def density(picture: Float32) -> Float32:
        return _density(picture, row_weight, settings)

    context = replace(context, density=density, wraps=wraps)
    pictures = [luminance]
    if look.operator.sees == "channels":
        planes = linear_light.to_rgb_linear(frame, clip=True)
        pictures = [_at_size(plane, width, height) for plane in planes]
    maps = []
    for picture in pictures:
        maps.append(np.zeros((height, width), np.float32))
        maps[-1][inner] = look.operator.map(picture[inner], context)
    return maps[0] if len(maps) == 1 else np.dstack(maps)


def _map_of_rgb(frame: Frame, size: tuple[int, int], look: Look, recall: Recall) -> Float32:
    """The map of an operator that takes linear RGB at analysis size."""
    wraps = look.settings.projection == "latlong"
    context = replace(context_of(None, look), wraps=wraps, recall=recall)
    rgb = recall("rgb", lambda: frame_rgb_small(frame, size))
    inner = recall("inner", lambda: _inner(luminance_of_pixels(rgb), wraps))
    own = look.operator.map(rgb[inner], context)
    if own.shape[:2] == rgb.shape[:2]:
        return own
    key_map = np.zeros((size[1], size[0], own.shape[2]), np.float32)
    key_map[inner] = own
    return key_map


def _row_weight(height: int, wraps: bool) -> Float64 | None:
    """The solid angle of a panorama's rows, relative to the equator's; None for flat pictures."""
    return np.cos(((np.arange(height) + 0.5) / height - 0.5) * np.pi) if wraps else None


def _inner(luminance: Float32, wraps: bool) -> tuple[slice, slice]:
    """The rows and columns inside black bars; panoramas have no bars."""
    height, width = luminance.shape
    if wraps:
        return slice(0, height), slice(0, width)
    edge = find_bars(luminance)
    return slice(edge.top, height - edge.bottom), slice(edge.left, width - edge.right)


def key_lights(frame: Frame, settings: Settings) -> list[tuple[float, float]]:
    """Positions of the frame's median-cut lights, (x, y) from 0 to 1 across the whole picture.

    They are the lights of the Expand Map: at analysis size, without bars.
    """
    width, height = analysis_size(*frame.size, settings.map_width)
    luminance = _at_size(frame_luminance(frame), width, height)
    wraps = settings.projection == "latlong"
    rows, columns = _inner(luminance, wraps)
    picture = np.ascontiguousarray(luminance[rows, columns])
    lights = median_cut(picture, settings.lights, _row_weight(height, wraps))
    return [
        ((float(x) + columns.start + 0.5) / width, (float(y) + rows.start + 0.5) / height)
        for x, y in zip(lights.x, lights.y, strict=True)
    ]


def _at_size(plane: Float32, width: int, height: int) -> Float32:
    if plane.shape == (height, width):
        return plane
    return np.clip(averaged(plane, (width, height)), 0, 1)


def _density(luminance: Float32, row_weight: Float64 | None, settings: Settings) -> Float32:
    height, width = luminance.shape
    lights = median_cut(luminance, settings.lights, row_weight)
    radius_px = scaled_radius_px(settings.radius, width, height)
    density = density_map_soft if settings.soft_lights else density_map
    wrap_x = row_weight is not None
    return density(lights, (height, width), radius_px, settings.min_lights, wrap_x=wrap_x)
