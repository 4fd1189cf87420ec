"""The Expand Map: the density of a picture's lights around each pixel (section 2.3).

Positions and radii are in pixels of the analysis picture, with pixel centres at whole numbers. A
light's power is luminance * pixels with white at 1, so a white area of any size has density 1.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Sequence
from typing import Any, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from itmo_video.expand_map.median_cut import Lights
from itmo_video.model import Float32, Float64

Floats: TypeAlias = npt.NDArray[np.floating[Any]]
Indices: TypeAlias = npt.NDArray[np.intp]

GAMMA, BETA = 0.918, 1.953  # eq. 16's, after Pavicic 1990

RAMP_BELOW, RAMP_ABOVE = 2.1, 1.9  # lights below and above the threshold

_PAPER_PIXELS = 512 * 768  # the pictures that the paper's radius of 16 was chosen on
_MAX_PAIRS = 1_000_000  # light-pixel pairs processed at a time: bounds memory on large pictures


def scaled_radius_px(radius: float, width: int, height: int) -> float:
    """The radius r_t for a picture of this size, the paper's 16 being for 512x768 pixels.

    Departs from the paper, which has one radius: the number of lights is fixed, so the radius has
    to scale with the root of the area.
    """
    return radius * math.sqrt(width * height / _PAPER_PIXELS)


def kernel_weight(distance_px: npt.ArrayLike, r_max_px: npt.ArrayLike) -> Float64:
    """Gaussian filter weight of a light at `distance_px`, eq. 16.

    Any shapes that broadcast, 0 <= distance_px <= r_max_px. GAMMA if `r_max_px` is 0, which
    eq. 16 leaves open: all lights within reach are then on the pixel itself.
    """
    distance, r_max = np.asarray(distance_px, np.float64), np.asarray(r_max_px, np.float64)
    ratio = distance / np.where(r_max > 0.0, r_max, 1.0)
    return _weight_of_square(np.where(r_max > 0.0, ratio * ratio, 0.0))


def white_density(radius_px: float) -> float:
    """Density, by eq. 17, of a uniformly white picture far from its edges.

    The sum of eq. 16 with r_max = radius_px >= 0 over the whole pixels of a disc.
    """
    offset = np.arange(-math.floor(radius_px), math.floor(radius_px) + 1.0)
    squares = np.add.outer(offset * offset, offset * offset)
    inside = squares[squares <= radius_px * radius_px]
    return float(kernel_weight(np.sqrt(inside), radius_px).sum())


def density_map(
    lights: Lights,
    shape_hw: tuple[int, int],
    radius_px: float,
    min_lights: float,
    wrap_x: bool = False,
) -> Float32:
    """The Expand Map of a picture: eq. 17 over the lights within `radius_px`, relative to white.

    The weights are eq. 16, with r_max the distance of the farthest light within reach. 0 where
    fewer than `min_lights` are within reach (section 2.3: 4 to 6), clipped at 1. Float32 (H, W) in
    [0, 1]. Lights must lie on the picture; with `wrap_x` (panoramas) left and right edges join, and
    a light counts at its nearest image. Raises ValueError for an empty shape or a bad radius.
    """
    height, width = _checked(shape_hw, radius_px)
    lights = _able_to_count(lights, width, radius_px, min_lights, wrap_x)
    window = (2 * min(radius_px, height) + 2) * (2 * min(radius_px, width) + 2)  # at most
    step = max(1, int(_MAX_PAIRS / window))
    parts = [slice(i, i + step) for i in range(0, len(lights.x), step)]

    def pairs() -> Iterator[tuple[Indices, Indices, Float64]]:
        for part in parts:
            yield _pairs(lights, part, (height, width), radius_px, wrap_x)

    # Two passes over the pairs, as a pixel's r_max is known only after all its lights.
    seen = list(pairs()) if len(parts) == 1 else None
    count = np.zeros(height * width, dtype=np.intp)
    r_max_square = np.zeros(height * width)
    for pixel, _, square in seen or pairs():
        count += np.bincount(pixel, minlength=count.size)
        np.maximum.at(r_max_square, pixel, square)
    enough = count >= min_lights
    r_max_square[r_max_square == 0.0] = 1.0  # squares there are 0, so eq. 16 gives GAMMA

    density = np.zeros(height * width)
    for pixel, light, square in seen or pairs():
        kept = np.flatnonzero(enough[pixel])
        pixel, light, square = pixel[kept], light[kept], square[kept]
        weighted = lights.power[light] * _weight_of_square(square / r_max_square[pixel])
        density += np.bincount(pixel, weights=weighted, minlength=density.size)
    density /= white_density(radius_px)  # departs from the paper, which does not give the scale
    return np.minimum(density, 1.0).astype(np.float32).reshape(height, width)


def density_map_soft(
    lights: Lights,
    shape_hw: tuple[int, int],
    radius_px: float,
    min_lights: float,
    wrap_x: bool = False,
) -> Float32:
    """Expand Map that changes smoothly as lights move, for video; contract as `density_map`.

    Departs from the paper in four ways, each of which removes a jump: r_max is the radius itself in
    eq. 16; lights are distributed bilinearly over the four pixels around them; the part of the disc
    outside the picture does not count, so that a sky is not darker at the frame's edge; and the
    threshold is a smooth ramp around `min_lights` on a count with a soft-edged disc (chosen so that
    the mean map equals the hard one's over many panoramas). No threshold at `min_lights` <= 1.
    """
    height, width = _checked(shape_hw, radius_px)
    is_thresholded = min_lights > 1
    kernels, share, size = _soft_kernels((height, width), radius_px, is_thresholded, wrap_x)
    splats = np.zeros((len(kernels), *size), np.float32)
    _splat(lights, lights.power, splats[0])
    if is_thresholded:
        _splat(lights, np.ones_like(lights.power), splats[1])
    sums = _convolved(splats, kernels)[:, :height, :width] / share
    density = np.clip(sums[0], 0.0, 1.0)  # rounding leaves tiny negative values
    if is_thresholded:
        start, end = max(min_lights - RAMP_BELOW, 0.0), min_lights + RAMP_ABOVE
        ramp = np.clip((sums[1] - np.float32(start)) / np.float32(end - start), 0.0, 1.0)
        density *= ramp * ramp * (3.0 - 2.0 * ramp)
    return np.ascontiguousarray(density, dtype=np.float32)


@functools.lru_cache(maxsize=4)
def _soft_kernels(
    shape_hw: tuple[int, int], radius_px: float, is_thresholded: bool, wrap_x: bool
) -> tuple[list[Float32], Float32, tuple[int, int]]:
    """The spectra of the weights' and the count's kernels, their shares, and the transform's size.

    Shares, (1 or 2, H, W), are those of each kernel inside the picture.
    """
    height, width = shape_hw
    edge_px = max(1.0, 0.15 * radius_px)  # width of the soft edge, centred on the radius
    reach = math.ceil(radius_px + 0.5 * edge_px)
    # FFT takes half of filter2D's time at a radius of 10 px, and the same for any other.
    # Padding keeps the picture's edges apart; without it they wrap around.
    room_y, room_x = min(reach, height - 1), min(reach, width // 2 if wrap_x else width - 1)
    rows = cv2.getOptimalDFTSize(height + room_y)
    columns = width if wrap_x else cv2.getOptimalDFTSize(width + room_x)

    dy = np.arange(-room_y, room_y + 1.0)[:, np.newaxis]
    dx = np.arange(-room_x, room_x + 1.0)  # where both ends meet, half a turn off, they agree
    square = dy * dy + dx * dx
    kernels = np.zeros((2 if is_thresholded else 1, rows, columns), np.float32)
    at = np.ix_(dy.ravel().astype(np.intp) % rows, dx.astype(np.intp) % columns)
    radius_square = radius_px * radius_px
    weight = _weight_of_square(square / (radius_square or 1.0)) / white_density(radius_px)
    kernels[0][at] = np.where(square <= radius_square, weight, 0.0)
    if is_thresholded:
        kernels[1][at] = np.clip((radius_px - np.sqrt(square)) / edge_px + 0.5, 0.0, 1.0)
    spectra = [_spectrum(kernel) for kernel in kernels]
    picture = np.zeros_like(kernels)
    picture[:, :height, :width] = 1
    share = _convolved(picture, spectra)[:, :height, :width]
    share = share / kernels.sum((1, 2), dtype=np.float64)[:, None, None]
    return spectra, share.astype(np.float32), (rows, columns)


def _spectrum(plane: Float32) -> Float32:
    """The spectrum as cv2 packs it; scipy.fft is as fast but takes 0.12 s to import."""
    return np.asarray(cv2.dft(plane), np.float32)


def _convolved(planes: Float32, spectra: Sequence[Float32]) -> Float32:
    """Each plane of (n, H, W) convolved circularly with its kernel, given as a spectrum."""
    back = cv2.DFT_INVERSE | cv2.DFT_SCALE | cv2.DFT_REAL_OUTPUT
    products = (
        cv2.mulSpectrums(_spectrum(plane), spectrum, 0)
        for plane, spectrum in zip(planes, spectra, strict=True)
    )
    return np.stack([np.asarray(cv2.dft(part, flags=back), np.float32) for part in products])


def _weight_of_square(ratio_square: Float64) -> Float64:
    """Eq. 16 of (distance / r_max) squared, float64 of any shape."""
    scale = GAMMA / -math.expm1(-BETA)
    weight = np.exp(ratio_square * (-0.5 * BETA))
    weight *= scale
    weight += GAMMA - scale
    return np.asarray(weight)


def _checked(shape_hw: tuple[int, int], radius_px: float) -> tuple[int, int]:
    """Return the shape, or raise ValueError."""
    if min(shape_hw) < 1 or not (radius_px >= 0.0 and math.isfinite(radius_px)):
        raise ValueError(f"needs a picture and a radius >= 0, not {shape_hw} and {radius_px} px")
    return shape_hw


def _able_to_count(
    lights: Lights, width: int, radius_px: float, min_lights: float, wrap_x: bool
) -> Lights:
    """Drop lights that cannot reach a pixel above the threshold, with the paper's 2D-tree.

    Lights within reach of one pixel are within two radii of each other, so a light with too few
    such neighbours contributes to no pixel that counts.
    """
    if min_lights <= 1:
        return lights
    from scipy.spatial import cKDTree  # takes 0.1 s to import, for the hard threshold only

    tree = cKDTree(
        np.column_stack((lights.x, lights.y)), boxsize=np.array([width if wrap_x else 0.0, 0.0])
    )
    diameter = 2.0 * radius_px * (1.0 + 1e-9)  # slightly more, so that rounding loses none
    near = tree.query_ball_point(tree.data, diameter, return_length=True)
    able = near >= min_lights
    return Lights(lights.x[able], lights.y[able], lights.power[able], lights.regions[able])


def _pairs(
    lights: Lights, part: slice, shape_hw: tuple[int, int], radius_px: float, wrap_x: bool
) -> tuple[Indices, Indices, Float64]:
    """All pairs of a pixel and a light within its radius.

    Returns the flat index of the pixel, the index of the light and their squared distance.
    Departs from the paper's search for the lights near each pixel: pixels are on a grid, so those
    near each light are known without a search.
    """
    height, width = shape_hw
    row, dy = _axis_window(lights.y[part], height, radius_px, wrap=False)
    column, dx = _axis_window(lights.x[part], width, radius_px, wrap=wrap_x)
    square = (dy * dy)[:, :, np.newaxis] + (dx * dx)[:, np.newaxis, :]
    pixel = (row * width)[:, :, np.newaxis] + column[:, np.newaxis, :]
    inside = square <= radius_px * radius_px
    light = np.repeat(
        np.arange(*part.indices(len(lights.x))), np.count_nonzero(inside, axis=(1, 2))
    )
    return pixel[inside], light, square[inside]


def _axis_window(
    centre_px: Float64, size: int, radius_px: float, *, wrap: bool
) -> tuple[Indices, Float64]:
    """Index and signed distance, both (n, m), of the m pixels around each centre.

    The distance is infinite for those outside the picture.
    """
    reach = min(math.floor(radius_px + 0.5), size)
    nearest = np.rint(centre_px).astype(np.intp)
    index = nearest[:, np.newaxis] + np.arange(-reach, reach + 1)
    distance = index - centre_px[:, np.newaxis]
    if wrap:  # the nearest image only; otherwise a light counts twice on a narrow picture
        distance[(distance < -0.5 * size) | (distance >= 0.5 * size)] = np.inf
        return index % size, distance
    outside = (index < 0) | (index >= size)
    distance[outside] = np.inf
    index[outside] = 0
    return index, distance


def _splat(lights: Lights, values: Float64, out: Float32) -> None:
    """Add each light's value to the four pixels of `out` around it, bilinearly, in place.

    The picture is at the top left of `out`; the neighbour of the last pixel is the first.
    """
    left, top = np.floor(lights.x), np.floor(lights.y)
    x0, y0 = left.astype(np.intp), top.astype(np.intp)
    x1, y1 = (x0 + 1) % out.shape[1], (y0 + 1) % out.shape[0]
    right, bottom = lights.x - left, lights.y - top
    for y, share_y in ((y0, 1.0 - bottom), (y1, bottom)):
        for x, share_x in ((x0, 1.0 - right), (x1, right)):
            np.add.at(out, (y, x), (share_y * share_x * values).astype(np.float32))
