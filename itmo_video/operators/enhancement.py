"""Linear stretching with a brightness enhancement around clipped areas: Rempel and followers.

Both stretch the picture to L'max / alpha and multiply it by 1 to alpha near clipped light, as given
by a map. The operator computes the map at keyframes.

Both are from memory: Kovaleski and Oliveira's constants agree with the HDR Toolbox by Banterle et
al.; Rempel's publication was not available.
"""

from __future__ import annotations

import cv2
import numpy as np

from itmo_video.model import Float32
from itmo_video.operators.base import Context, Floats, Parameter, code_of_light
from itmo_video.operators.bilateral_grid import cross_bilateral
from itmo_video.operators.luminance_operator import LuminanceOperator

_WIDTH = 1920  # pixels; the publications give filter sizes for HD pictures
_GRADIENT = 0.05  # of codes: an edge that stops the enhancement
_LEAST = 0.001  # of the blurred mask


def gain_enhanced(luminance: Float32, context: Context) -> Float32:
    """L'max: the gain where the map is 1."""
    return np.full_like(luminance, context.l_max)


def curve_enhanced(luminance: Floats, context: Context) -> Floats:
    """L'max * L_d: the expanded luminance where the map is 1."""
    return context.l_max * luminance


def base_enhanced(context: Context) -> float:
    """L'max / alpha: the gain where the map is 0."""
    return context.l_max / context.params["alpha"]


def map_rempel2007(luminance: Float32, context: Context) -> Float32:
    """The blurred mask of clipped pixels, stopped at strong edges: float32 (H, W) in [0, 1].

    The blur is a Gaussian of `sigma` pixels at HD. The edge stopping is a fill that starts from
    the clipped pixels and spreads where gradients are weak; the publication runs it on a pyramid,
    ours on the analysis picture. A pixel counts as clipped by its luminance, not by its channels,
    as an operator is given only luminance.
    """
    code = code_of_light(luminance)
    clipped = (code > context.params["clip_code"] / 255).astype(np.float32)
    sigma_px = max(0.5, context.params["sigma"] * luminance.shape[1] / _WIDTH)
    near = cv2.GaussianBlur(clipped, (0, 0), sigma_px, borderType=cv2.BORDER_REPLICATE)
    dx = cv2.Sobel(code, cv2.CV_32F, 1, 0, ksize=5, scale=1 / 128)
    dy = cv2.Sobel(code, cv2.CV_32F, 0, 1, ksize=5, scale=1 / 128)
    open_ = (np.hypot(dx, dy) < _GRADIENT) & (near > _LEAST) | (clipped > 0)
    count, labels = cv2.connectedComponents(open_.astype(np.uint8), connectivity=4)
    reached = np.zeros(count, bool)
    reached[labels[clipped > 0]] = True
    reached[0] = False
    filled = cv2.morphologyEx(
        reached[labels].astype(np.float32), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)
    )
    soft = cv2.GaussianBlur(filled, (0, 0), 1, borderType=cv2.BORDER_REPLICATE)
    return np.asarray(np.clip(near * soft, 0, 1), np.float32)


def map_kovaleski2014(luminance: Float32, context: Context) -> Float32:
    """The mask of clipped pixels, cross-bilaterally filtered along luminance codes (eq. 3).

    Float32 (H, W) in [0, 1]; `sigma_space` in pixels at HD, `sigma_range` in codes of 0 to 255. As
    in `map_rempel2007` a pixel counts as clipped by its luminance.
    """
    code = code_of_light(luminance)
    clipped = (code > context.params["clip_code"] / 255).astype(np.float32)
    sigma_px = max(1.0, context.params["sigma_space"] * luminance.shape[1] / _WIDTH)
    return cross_bilateral(clipped, code, sigma_px, context.params["sigma_range"] / 255)


_ALPHA = Parameter(
    4.0, 1.0, 100.0, "maximum enhancement; the picture is stretched to maximum/alpha"
)
_CLIP = Parameter(230.0, 128.0, 254.0, "code above which a pixel counts as clipped (video: 230)")

OPERATORS = (
    LuminanceOperator(
        "rempel2007",
        "LDR2HDR: stretched, and enhanced near clipped areas, stopping at strong edges",
        "Rempel, Trentacoste, Seetzen, Young, Heidrich, Whitehead and Ward, Ldr2Hdr, ACM TOG "
        "26(3) 2007",
        gain_enhanced,
        {
            "alpha": _ALPHA,
            "clip_code": _CLIP,
            "sigma": Parameter(30.0, 1.0, 500.0, "of the blur, in pixels of an HD frame"),
        },
        curve=curve_enhanced,
        make_map=map_rempel2007,
        base=base_enhanced,
    ),
    LuminanceOperator(
        "kovaleski2014",
        "stretched, and enhanced near clipped areas with a bilateral grid",
        "Kovaleski and Oliveira, High-quality reverse tone mapping for a wide range of "
        "exposures, SIBGRAPI 2014",
        gain_enhanced,
        {
            "alpha": _ALPHA,
            "clip_code": _CLIP,
            "sigma_range": Parameter(25.0, 1.0, 255.0, "of luminance, in codes"),
            "sigma_space": Parameter(150.0, 4.0, 1000.0, "in pixels of an HD frame"),
        },
        curve=curve_enhanced,
        make_map=map_kovaleski2014,
        base=base_enhanced,
    ),
)
