"""Optical flow: warping a map from one frame to another, and how far to trust the result.

All pictures here are at analysis size. A flow belongs to the frame that it starts from:
`flow_px[y, x]` is where pixel (x, y) of `here` is in `there`, relative to (x, y), so a map of
`there` is warped to `here` by looking it up at (x, y) + flow.
"""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable, Sequence
from typing import cast

import cv2
import numpy as np

from itmo_video.kernels import compiled, compiled_maps
from itmo_video.kernels.dispatch import with_compiled_form
from itmo_video.model import Code, Float32, Float64

AGREEMENT_SIGMA = 6.0  # 8-bit codes: a difference of this size counts for 1/e as much
AGREEMENT_BLUR_PX, FINE_BLUR_PX = 9, 5  # of large and of small pictures
FLOW_MARGIN = 0.75  # 8-bit codes: a motion must explain the picture better by this much
CAMERA_SHARE = 0.15  # of the picture: a camera that moves explains at least this much better
CAMERA_WORSE = 1 / 3  # of that: it explains at most this much worse
CAMERA_STEP_PX = 12
CAMERA_SIGMAS_PX = (16.0, 8.0, 4.0, 2.0, 1.0, 0.5, 0.5)  # by rounds; this far off counts a quarter
CAMERA_RIDGE = 1e-6  # of the weights' sum: texture in a single place leaves no slope
LARGE_PX = 320  # a longer side above this makes a picture large
_local = threading.local()


def motion_picture(grey: Code) -> Code:
    """The picture in which motion is estimated: of half the size, if that is enough.

    For large pictures DIS stops at a quarter of the size, so half the size serves as well, and
    everything done with a flow costs a quarter.
    """
    height, width = grey.shape
    if max(grey.shape) <= LARGE_PX or min(grey.shape) < 128:
        return grey
    half = ((width + 1) // 2, (height + 1) // 2)
    return cast(Code, cv2.resize(grey, half, interpolation=cv2.INTER_AREA))


def flow_px(here: Code, there: Code) -> Float32:
    """Dense DIS flow from `here` to `there`, (H, W, 2) float32 in pixels; 8-bit grey in.

    Where the camera's motion explains the picture as well as the flow does, it is used instead, so
    that noise in flat areas moves nothing and a plain sky moves with the rest of the picture.
    Pictures too small for DIS (under 16 px) do not move.
    """
    if min(here.shape) < 16:
        return np.zeros((*here.shape, 2), np.float32)
    # A DIS object shared by threads crashes, so each thread has its own. A small picture lowers
    # an object's coarsest scale permanently, so each size has its own, too.
    shape, dis = getattr(_local, "dis", (None, None))
    if shape != here.shape or dis is None:
        dis = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_FAST)
        if not bears_quarter_size(*here.shape):
            dis.setFinestScale(0)
        elif max(here.shape) <= LARGE_PX:
            dis.setFinestScale(1)
            dis.setVariationalRefinementIterations(0)  # carries maps as well, in half the time
        _local.dis = (here.shape, dis)
    flow = np.asarray(dis.calc(here, there, None), np.float32)
    return steadied(here, there, flow)


def bears_quarter_size(height: int, width: int) -> bool:
    """Whether DIS can stop at a quarter of the size, as its preset FAST does.

    Its coarsest scale is the lesser of log2(longer side / 32), rounded, and log2(shorter side / 8),
    truncated (OpenCV's dis_flow.cpp). If that is finer than the finest scale requested, DIS derives
    scales from the width alone, which reads outside low pictures, and keeps them, so that a second
    call gives another flow than the first.
    """
    return min(height, width) >= 32 and max(height, width) >= 91


def steadied(here: Code, there: Code, flow: Float32) -> Float32:
    """The flow, blended into the camera's motion where that explains the picture as well.

    The camera counts as still unless its motion explains a good part of the picture better, and
    far less of it worse, than no motion: a small bright moving object is not a camera.
    """
    camera = camera_motion_px(here, flow)
    plain = local_difference(here, warp(there, camera))
    still = local_difference(here, there)
    better = np.count_nonzero(still - plain > FLOW_MARGIN)
    if better < CAMERA_SHARE * here.size or (
        np.count_nonzero(plain - still > FLOW_MARGIN) > CAMERA_WORSE * better
    ):
        camera, plain = np.zeros_like(flow), still
    moved = local_difference(here, warp(there, flow))
    trust = np.clip((plain - moved) / np.float32(FLOW_MARGIN), 0, 1)
    trust = cv2.blur(trust, _blur_size(here))
    return np.asarray(cv2.blendLinear(flow, camera, trust, 1 - trust), np.float32)


def camera_motion_px(here: Code, flow: Float32) -> Float32:
    """The affine motion that most textured places of a flow agree on, (H, W, 2) float32.

    Least squares, reweighted by Geman and McClure's function with a decreasing scale, which
    excludes moving objects; places without texture do not count. Zero if nothing has texture.
    """
    height, width = here.shape
    every = slice(CAMERA_STEP_PX // 2, None, CAMERA_STEP_PX)
    slope = cv2.add(*(cv2.convertScaleAbs(s) for s in cv2.spatialGradient(here)))
    texture = (
        cv2.blur(slope, (CAMERA_STEP_PX, CAMERA_STEP_PX))[every, every].ravel().astype(np.float64)
    )
    if not texture.any():
        return np.zeros_like(flow)
    vectors = np.ascontiguousarray(flow[every, every].reshape(-1, 2).T, np.float64)
    across, down = _shares_of_sides(height, width)
    model = camera_model(across, down, vectors, texture, CAMERA_SIGMAS_PX, CAMERA_RIDGE)
    # From shares of the picture's sides to pixels.
    model[1:] /= [[width], [height]]
    model[0] -= (model[1] * width + model[2] * height) / 2
    return np.asarray(cv2.transform(_grid(height, width), model[[1, 2, 0]].T), np.float32)


@with_compiled_form(compiled.camera_model)
def camera_model(
    across: Float64,
    down: Float64,
    vectors: Float64,
    texture: Float64,
    sigmas: Sequence[float],
    ridge: float,
) -> Float64:
    """Constant, slope across and slope down (3, 2) of the motion that most places agree on.

    `across`, `down` and `texture` (N,), `vectors` (2, N); reweighted by `sigmas`, in pixels, one
    per round; `ridge` times the weights' sum keeps undetermined slopes at 0.
    """
    terms = np.stack([np.ones(across.size), across, down])
    # The terms of both sides of the normal equations, a column per place.
    products = (terms[:, None] * np.concatenate([terms, vectors])).reshape(15, -1)
    weight, model = texture, np.zeros((3, 2))
    for sigma_px in sigmas:
        # einsum, as BLAS may sum in another order on another machine of a cluster
        sides = np.einsum("kn,n->k", products, weight).reshape(3, 5)
        normal = sides[:, :3]
        normal[[1, 2], [1, 2]] += ridge * normal[0, 0]
        model = np.linalg.solve(normal, sides[:, 3:])
        off = np.square(vectors - np.einsum("in,ij->jn", terms, model)).sum(0)
        weight = texture / np.square(1 + off / sigma_px**2)
    return model


def warp(image: Code | Float32, flow: Float32) -> Float32:
    """`image` (there) warped along `flow` (from here): same shape, bilinear, edges repeated."""
    how = cv2.INTER_LINEAR | cv2.WARP_RELATIVE_MAP
    return np.asarray(cv2.remap(image, flow, None, how, borderMode=cv2.BORDER_REPLICATE))


def compose(first: Float32, second: Float32) -> Float32:
    """The flow from a to c, composed of a to b and b to c."""
    across, down = (warp(part, first) for part in cv2.split(second))  # cv2 is slow for two channels
    return np.asarray(cv2.add(first, cv2.merge([across, down])), np.float32)


def warp_map(key_map: Float32, flow: Float32) -> Float32:
    """A map (there) warped along a flow of its size or a smaller one: same shape."""
    (height, width), (h, w) = key_map.shape[:2], flow.shape[:2]
    if (height, width) != (h, w):
        # By whole lines, as NumPy takes ten times as long for an inner axis of two.
        scale = np.tile(np.array([width / w, height / h], np.float32), w)
        scaled = (flow.reshape(h, 2 * w) * scale).reshape(h, w, 2)
        flow = cv2.resize(scaled, (width, height), interpolation=cv2.INTER_LINEAR)
    return warp(key_map, flow)


def weight_of(agreed: Float32, key_map: Float32) -> Float32:
    """A weight of the motion picture's size at a map's size: (H, W)."""
    height, width = key_map.shape[:2]
    if agreed.shape == (height, width):
        return agreed
    return np.asarray(cv2.resize(agreed, (width, height), interpolation=cv2.INTER_LINEAR))


def local_difference(a: Code, b: Code | Float32) -> Float32:
    """Mean absolute difference in a small square around each pixel, in 8-bit codes."""
    return np.asarray(cv2.boxFilter(cv2.absdiff(a, b), cv2.CV_32F, _blur_size(a)), np.float32)


def _blur_size(picture: Code) -> tuple[int, int]:
    blur_px = AGREEMENT_BLUR_PX if max(picture.shape) > LARGE_PX else FINE_BLUR_PX
    return blur_px, blur_px


def agreement(here: Code, there: Code, flow: Float32) -> Float32:
    """How well `there`, warped, explains `here`: (H, W) in (0, 1]."""
    difference = local_difference(here, warp(there, flow))
    agreed = np.exp(difference * np.float32(-1 / AGREEMENT_SIGMA)) + np.float32(1e-6)
    return np.asarray(agreed, np.float32)


def blend_maps(
    left: Float32, right: Float32, t: float, w_left: Float32 | float, w_right: Float32 | float
) -> Float32:
    """Blend two warped maps by time (t from 0 at left to 1 at right) and agreement.

    The weights may be of a smaller size.
    """
    a, b = np.float32(1 - t) * w_left, np.float32(t) * w_right
    share = np.asarray(b / (a + b), np.float32)
    if share.ndim == 0:
        return _blend(left, right, np.broadcast_to(share, left.shape[:2]))
    return _blend(left, right, weight_of(share, left))


@with_compiled_form(compiled_maps.blend)
def _blend(left: Float32, right: Float32, share: Float32) -> Float32:
    return np.asarray((right - left) * spread(share, left) + left, np.float32)


@with_compiled_form(compiled_maps.add_weighed)
def add_weighed(total: Float32, values: Float32, weight: Float32) -> None:
    """Add a map times a weight to another, in place: (H, W) or (H, W, C), the weight (H, W)."""
    total += values * spread(weight, values)


def spread(weight: Float32, values: Float32) -> Float32:
    """A weight (H, W) as it multiplies maps of several channels, (H, W, C)."""
    if weight.ndim == values.ndim:
        return weight
    merged = cv2.merge([weight] * values.shape[2])  # faster than broadcasting
    return np.asarray(merged).reshape(values.shape)


FindFlow = Callable[[Code, Code], Float32]


def track_map(
    here: Code,
    left: tuple[Code, Float32],
    right: tuple[Code, Float32],
    t: float,
    find_flow: FindFlow = flow_px,
) -> Float32:
    """The map of the frame `here` from the (picture, map) of the keyframes on either side.

    Pictures are `motion_picture`s, of one size; maps may be larger.
    """
    seen: list[Float32] = []
    weights: list[Float32] = []
    if not any(cv2.hasNonZero(key_map.reshape(len(key_map), -1)) for _, key_map in (left, right)):
        return left[1]
    for there, key_map in (left, right):
        flow = find_flow(here, there)
        seen.append(warp_map(key_map, flow))
        weights.append(agreement(here, there, flow))
    return blend_maps(seen[0], seen[1], t, weights[0], weights[1])


@functools.lru_cache(maxsize=8)
def _shares_of_sides(height: int, width: int) -> tuple[Float64, Float64]:
    """Where the places of a camera's motion are, from -0.5 to 0.5 of the picture's sides."""
    y, x = (np.arange(CAMERA_STEP_PX // 2, side, CAMERA_STEP_PX) for side in (height, width))
    across, down = np.meshgrid(x / width - 0.5, y / height - 0.5)
    return across.ravel(), down.ravel()


def _grid(height: int, width: int) -> Float32:
    cached = getattr(_local, "grid", None)
    if cached is None or cached.shape[:2] != (height, width):
        x, y = np.meshgrid(np.arange(width), np.arange(height))
        cached = _local.grid = np.dstack([x, y]).astype(np.float32)
    return np.asarray(cached)
