"""A simple scene lit by a panorama, for judging a conversion as a light source (paper, figure 8).

Needs Mitsuba 3 (extra `ibl`), which is imported only when a scene is rendered.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from itmo_video.errors import UsageError
from itmo_video.evaluation.fidelity import LUMINANCE_WEIGHTS
from itmo_video.model import Float32, Float64

Floats: TypeAlias = npt.NDArray[np.floating[Any]]

WIDTH, HEIGHT = 200, 150
SAMPLES = 64  # a pixel; the environment is importance-sampled
SEED = 7  # the same for every panorama, so that noise is alike on both sides


@dataclass(frozen=True)
class Lighting:
    """How renders by a converted panorama agree with renders by the true one.

    `error` is the root mean square difference of luminance over the true mean. Shadows: `sharpness`
    is the 99th percentile of the gradient on the ground, stops a pixel, and `depth` the stops from
    its median to its 2nd percentile; each of the test and of the truth.
    """

    error: float
    sharpness: tuple[float, float]
    depth: tuple[float, float]


def render_lit(panorama: Floats) -> Float32:
    """Linear RGB (HEIGHT, WIDTH, 3) of a plane, a diffuse ball and a rough metal ball.

    `panorama` is linear RGB (H, W, 3), latitude-longitude, up at the top. Raises UsageError where
    Mitsuba is not installed.
    """
    try:
        import mitsuba as mi
    except ImportError as error:
        raise UsageError(
            "image-based lighting needs Mitsuba", remedy='Install it: pip install "itmo_video[ibl]"'
        ) from error
    mi.set_variant("scalar_rgb")
    light = np.ascontiguousarray(panorama, np.float32)
    scene = mi.load_dict(_scene(mi, mi.Bitmap(light)))
    return np.asarray(np.array(mi.render(scene, seed=SEED))[..., :3], np.float32)


def _scene(mi: Any, bitmap: Any) -> dict[str, Any]:
    move = mi.ScalarTransform4f
    view = move().look_at(origin=[0, 2.4, 6.0], target=[0, 0.7, 0], up=[0, 1, 0])
    ground = move().rotate([1, 0, 0], -90).scale(8)
    film = {"type": "hdrfilm", "width": WIDTH, "height": HEIGHT, "rfilter": {"type": "box"}}
    grey = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.6}}
    metal = {"type": "roughconductor", "material": "Al", "alpha": 0.2}
    return {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 4},
        "sensor": {
            "type": "perspective",
            "fov": 40,
            "to_world": view,
            "film": film,
            "sampler": {"type": "independent", "sample_count": SAMPLES},
        },
        "light": {"type": "envmap", "bitmap": bitmap},
        "plane": {"type": "rectangle", "to_world": ground, "bsdf": grey},
        "diffuse": {"type": "sphere", "center": [-1.1, 0.9, 0], "radius": 0.9, "bsdf": grey},
        "metal": {"type": "sphere", "center": [1.1, 0.9, 0], "radius": 0.9, "bsdf": metal},
    }


def compare_lit(test: Floats, truth: Floats) -> Lighting:
    """Agreement of two renders of the scene, linear RGB (HEIGHT, WIDTH, 3) each.

    Raises ValueError where their shapes differ.
    """
    if test.shape != truth.shape:
        raise ValueError(f"renders differ in size: {test.shape} and {truth.shape}")
    a, b = (np.asarray(x, np.float64) @ np.array(LUMINANCE_WEIGHTS) for x in (test, truth))
    error = math.sqrt(float(np.mean((a - b) ** 2))) / float(np.mean(b))
    (sharp_a, deep_a), (sharp_b, deep_b) = _shadow(a), _shadow(b)
    return Lighting(error, (sharp_a, sharp_b), (deep_a, deep_b))


def _shadow(luminance: Float64) -> tuple[float, float]:
    # The lower third sees nothing but the ground: the balls end above it.
    ground = np.log2(np.maximum(luminance[luminance.shape[0] * 2 // 3 :], 1e-9))
    slope = np.hypot(*np.gradient(ground))
    depth = float(np.median(ground) - np.percentile(ground, 2))
    return float(np.percentile(slope, 99)), depth
