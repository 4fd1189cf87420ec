"""The compiled form of a keyframe's planes near white, of (H, W, 3) and (H, W)."""

from __future__ import annotations

import ctypes

import numpy as np

from itmo_video.kernels.compiled import Float32, alike, whole


def greatest(loaded: ctypes.CDLL, rgb: Float32) -> Float32:
    """`colour.luminance.greatest_of`: (H, W)."""
    rgb, out = whole(rgb), _plane_for(rgb)
    loaded.itmo_greatest(rgb, out.size, out)
    return out


def luminance(loaded: ctypes.CDLL, rgb: Float32) -> Float32:
    """`colour.luminance.luminance_of_pixels`: (H, W)."""
    rgb, out = whole(rgb), _plane_for(rgb)
    loaded.itmo_luminance(rgb, out.size, out)
    return out


def weighed_by_light(
    loaded: ctypes.CDLL, rgb: Float32, low: float, high: float
) -> tuple[Float32, Float32]:
    """`auto_parting.weighed_by_light`."""
    rgb, weight = whole(rgb), _plane_for(rgb)
    out = np.empty_like(rgb)
    loaded.itmo_weighed_by_light(rgb, low, 1 / (high - low), weight.size, weight, out)
    return weight, out


def mean_colour(
    loaded: ctypes.CDLL, around: Float32, own: Float32, weight: Float32, trace: float
) -> Float32:
    """`auto_parting.mean_colour`."""
    around, own, weight = whole(around), whole(own), whole(weight)
    _check(weight, around, own)
    out = np.empty_like(own)
    loaded.itmo_mean_colour(around, own, weight, trace, weight.size, out)
    return out


def share_ramps(
    loaded: ctypes.CDLL, part: Float32, all_: Float32, least: float, low: float, high: float
) -> Float32:
    """`auto_clipping.share_ramps`."""
    part, all_ = whole(part), whole(all_)
    alike(part, all_)
    out = np.empty_like(part)
    loaded.itmo_share_ramps(part, all_, least, low, 1 / (high - low), out.size, out)
    return out


def with_near(
    loaded: ctypes.CDLL, known: Float32, around: Float32, low: float, high: float
) -> Float32:
    """`auto_clipping.with_near`."""
    known, around = whole(known), whole(around)
    _check(_plane_for(known), known, around)
    out = np.empty_like(known)
    loaded.itmo_with_near(known, around, low, 1 / (high - low), known.size // 3, out)
    return out


def bounded_parting(
    loaded: ctypes.CDLL,
    levels: Float32,
    colour: Float32,
    lost: Float32,
    apart: float,
    free: tuple[float, float],
    dark: float,
) -> Float32:
    """`auto_parting.bounded_parting`: `apart` times the colour's span to the power of 1.5."""
    levels, colour, lost = whole(levels), whole(colour), whole(lost)
    _check(_plane_for(levels), levels, colour, lost)
    out = np.empty_like(levels)
    numbers = np.array([apart, free[0], 1 / (free[1] - free[0]), dark], np.float32)
    loaded.itmo_bounded_parting(levels, colour, lost, numbers, levels.size // 3, out)
    return out


def held_together(loaded: ctypes.CDLL, stops: Float32, lost: Float32, decided: Float32) -> Float32:
    """`auto_parting.held_together`."""
    stops, lost, decided = whole(stops), whole(lost), whole(decided)
    _check(decided, stops, lost)
    out = np.empty_like(stops)
    loaded.itmo_held_together(stops, lost, decided, decided.size, out)
    return out


def _plane_for(rgb: Float32) -> Float32:
    """An empty plane of a picture's size."""
    if rgb.ndim != 3 or rgb.shape[2] != 3:
        raise ValueError(f"a picture of shape {rgb.shape}")
    return np.empty(rgb.shape[:2], np.float32)


def _check(plane: Float32, *pictures: Float32) -> None:
    """Raise ValueError unless these are pictures of the plane's size, as C does not check it."""
    alike(*pictures)
    if pictures[0].shape != (*plane.shape, 3):
        raise ValueError(f"pictures of shape {pictures[0].shape} for a plane {plane.shape}")
