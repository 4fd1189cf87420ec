"""A simple scene lit by a panorama, to evaluate a conversion as a light source (figure 8).

Needs Mitsuba 3 (extra `ibl`), which is imported only when a scene is rendered.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from itmo_video.colour.primaries import LUMINANCE_WEIGHTS_BT709
from itmo_video.errors import UsageError
from itmo_video.model import Float32, Float64
from itmo_video.words import to_install

Floats: TypeAlias = npt.NDArray[np.floating[Any]]
Mask: TypeAlias = npt.NDArray[np.bool_]

WIDTH, HEIGHT = 200, 150
SAMPLES = 64  # a pixel; the environment is importance-sampled
_EYE, _TARGET, _FOV_DEG = (0.0, 2.4, 6.0), (0.0, 0.7, 0.0), 40.0
_GROUND, _RADIUS = 8.0, 0.9  # half a side of the plane
_CENTRES = ((-1.1, 0.9, 0.0), (1.1, 0.9, 0.0))
SEED = 7  # the same for every panorama, so that noise is alike on both sides


@dataclass(frozen=True)
class Lighting:
    """How close renders lit by a converted panorama are to those lit by the true one.

    `error` is the root mean square difference of luminance, where plane or balls are visible, over
    the true mean; `exposed_error` the same after the exposure that minimises it. Shadows, of test
    and truth: `sharpness` is the 99th percentile of the gradient on the ground in stops per pixel,
    `depth` the stops from its median to its 2nd percentile.
    """

    error: float
    exposed_error: float
    sharpness: tuple[float, float]
    depth: tuple[float, float]


def render_lit(panorama: Floats) -> Float32:
    """Linear RGB (HEIGHT, WIDTH, 3) of a plane, a diffuse ball and a rough metal ball.

    `panorama` is linear RGB (H, W, 3), latitude-longitude, the zenith at the top. Raises UsageError
    unless Mitsuba is installed.
    """
    mi = require_mitsuba()
    mi.set_variant("scalar_rgb")
    light = np.ascontiguousarray(panorama, np.float32)
    scene = mi.load_dict(_scene(mi, mi.Bitmap(light)))
    return np.asarray(np.array(mi.render(scene, seed=SEED))[..., :3], np.float32)


def require_mitsuba() -> Any:
    """The module of Mitsuba 3; raises UsageError unless it is installed."""
    try:
        import mitsuba
    except ImportError as error:
        raise UsageError(
            f"image-based lighting needs Mitsuba, which cannot be imported ({error})",
            remedy=to_install("ibl"),
        ) from error
    return mitsuba


def _scene(mi: Any, bitmap: Any) -> dict[str, Any]:
    move = mi.ScalarTransform4f
    view = move().look_at(origin=list(_EYE), target=list(_TARGET), up=[0, 1, 0])
    ground = move().rotate([1, 0, 0], -90).scale(_GROUND)
    film = {"type": "hdrfilm", "width": WIDTH, "height": HEIGHT, "rfilter": {"type": "box"}}
    grey = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.6}}
    metal = {"type": "roughconductor", "material": "Al", "alpha": 0.2}
    return {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 4},
        "sensor": {
            "type": "perspective",
            "fov": _FOV_DEG,
            "to_world": view,
            "film": film,
            "sampler": {"type": "independent", "sample_count": SAMPLES},
        },
        "light": {"type": "envmap", "bitmap": bitmap},
        "plane": {"type": "rectangle", "to_world": ground, "bsdf": grey},
        "diffuse": {"type": "sphere", "center": list(_CENTRES[0]), "radius": _RADIUS, "bsdf": grey},
        "metal": {"type": "sphere", "center": list(_CENTRES[1]), "radius": _RADIUS, "bsdf": metal},
    }


def compare_lit(test: Floats, truth: Floats) -> Lighting:
    """Agreement of two renders of the scene, linear RGB (HEIGHT, WIDTH, 3) each.

    Raises ValueError if their shapes differ.
    """
    if test.shape != truth.shape:
        raise ValueError(f"renders differ in size: {test.shape} and {truth.shape}")
    a, b = (np.asarray(x, np.float64) @ np.array(LUMINANCE_WEIGHTS_BT709) for x in (test, truth))
    lit = np.logical_or(*_what_is_seen())
    x, y = a[lit], b[lit]
    exposure = float(x @ y) / max(float(x @ x), 1e-30)
    error, exposed = (
        math.sqrt(float(np.mean((scale * x - y) ** 2))) / float(np.mean(y))
        for scale in (1.0, exposure)
    )
    (sharp_a, deep_a), (sharp_b, deep_b) = _shadow(a), _shadow(b)
    return Lighting(error, exposed, (sharp_a, sharp_b), (deep_a, deep_b))


def _shadow(luminance: Float64) -> tuple[float, float]:
    # A median removes the render's noise from the ground without moving the shadow's edge.
    smooth = cv2.medianBlur(luminance.astype(np.float32), 5)
    stops = np.log2(np.maximum(smooth, 1e-9).astype(np.float64))
    slope = np.hypot(*np.gradient(stops))
    ground = ground_mask()
    depth = float(np.median(stops[ground]) - np.percentile(stops[ground], 2))
    return float(np.percentile(slope[ground], 99)), depth


def ground_mask() -> Mask:
    """Pixels, (HEIGHT, WIDTH), that show the plane and whose neighbours do, too."""
    ground, _ = _what_is_seen()
    return np.asarray(cv2.erode(ground.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0)


def _what_is_seen() -> tuple[Mask, Mask]:
    """Pixels that show the plane, and pixels that show a ball; others show the panorama."""
    eye, target = np.array(_EYE), np.array(_TARGET)
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    half = math.tan(math.radians(_FOV_DEG / 2))
    x = (2 * (np.arange(WIDTH) + 0.5) / WIDTH - 1) * half
    y = (1 - 2 * (np.arange(HEIGHT) + 0.5) / HEIGHT) * half * HEIGHT / WIDTH
    up = np.cross(right, forward)
    ray = forward + x[None, :, None] * right + y[:, None, None] * up
    ray /= np.linalg.norm(ray, axis=-1, keepdims=True)
    with np.errstate(divide="ignore"):
        at = eye + ray * (-eye[1] / ray[..., 1:2])
    ground = (ray[..., 1] < 0) & (np.abs(at[..., [0, 2]]) < _GROUND).all(axis=-1)
    balls = np.zeros_like(ground)
    for centre in _CENTRES:
        to_ball = np.array(centre) - eye
        along = ray @ to_ball
        balls |= to_ball @ to_ball - along * along <= _RADIUS**2
    return ground & ~balls, balls
