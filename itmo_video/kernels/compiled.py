"""The compiled form of each kernel, for when the library was built.

Not to be called directly: dispatch.py combines each with its plain form.
"""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Sequence
from typing import Any, TypeAlias, TypeVar, cast

import numpy as np
import numpy.typing as npt

Bytes2D = npt.NDArray[np.uint8]
Codes: TypeAlias = npt.NDArray[np.uint8] | npt.NDArray[np.uint16]
Float32 = npt.NDArray[np.float32]
Plane = TypeVar("Plane", bound=npt.NDArray[Any])
Float64 = npt.NDArray[np.float64]
Half = npt.NDArray[np.float16]
Indices = npt.NDArray[np.int64]

_BLOCK_ROOM = 2 * 1024 + 32  # HEADER_ROOM for both blocks, zlib's bytes and the writer's last
AT_ONCE = 8  # as in upsampling.h


def alike(*arrays: npt.NDArray[Any] | None) -> None:
    """Raise ValueError unless all arrays (except None) have one shape, as C does not check it."""
    shapes = {array.shape for array in arrays if array is not None}
    if len(shapes) > 1:
        raise ValueError(f"arrays of different shapes: {', '.join(map(str, sorted(shapes)))}")


def whole(plane: npt.NDArray[Any]) -> Float32:
    """The plane as the kernels need it: contiguous float32."""
    return np.ascontiguousarray(plane, np.float32)


def pack_literals(loaded: ctypes.CDLL, rows: Bytes2D) -> list[bytes]:
    """Each row (count, size) as a zlib stream of Huffman-coded literals, without matches.

    The rows share two codes, one for their first halves and one for their second halves, where EXR
    puts the lower and the upper bytes of its pixels. `rows` are contiguous, of an even size above
    0, and less than 2**31 bytes in all. Releases the GIL.
    """
    count, size = rows.shape
    if size < 2 or size % 2 or rows.size >= 2**31:
        raise ValueError(f"rows of shape {rows.shape} cannot be packed")
    out = np.empty(count * (size * 14 // 8 + _BLOCK_ROOM), np.uint8)
    ends = np.empty(count, np.int64)
    loaded.itmo_pack_literals(rows, count, size, out, ends)
    starts = [0, *ends[:-1].tolist()]
    return [out[a:b].tobytes() for a, b in zip(starts, ends.tolist(), strict=True)]


def check_rows(rows: slice, plane: npt.NDArray[Any]) -> None:
    """Raise ValueError for rows outside the plane."""
    if not 0 <= rows.start <= rows.stop <= plane.shape[0]:
        raise ValueError(f"rows {rows.start} to {rows.stop} of {plane.shape[0]}")


def in_lines(plane: Plane) -> Plane:
    """The plane, or a copy with contiguous lines in native byte order."""
    if plane.strides[1] == plane.itemsize and plane.dtype.isnative:
        return plane
    return cast(Plane, np.ascontiguousarray(plane, plane.dtype.newbyteorder("=")))


def weighted_sum(
    loaded: ctypes.CDLL,
    rgb: Sequence[Float32],
    weights: Sequence[float],
    ratio: Float32 | None,
    out: Float32 | None = None,
) -> Float32:
    """The weighted sum of three planes, times `ratio` if any, clamped to [0, 1]: in `out` or new.

    All contiguous float32 of one shape.
    """
    out = np.empty_like(rgb[0]) if out is None else out
    factor = np.array(weights, np.float32)
    alike(*rgb, ratio, out)
    loaded.itmo_weighted_sum(
        *rgb, factor,
        ratio, out.size, out,
    )  # fmt: skip
    return out


def camera_model(
    loaded: ctypes.CDLL,
    across: Float64,
    down: Float64,
    vectors: Float64,
    texture: Float64,
    sigmas: Sequence[float],
    ridge: float,
) -> Float64:
    """`flow.camera_model` of float64 arrays, summed in the same order on all machines: (3, 2)."""
    alike(across, down, texture, *vectors)
    scales, weight, model = np.array(sigmas), np.empty(texture.size), np.empty((2, 3))
    loaded.itmo_camera_model(
        across, down, vectors, texture, texture.size,
        scales, scales.size, ridge, weight, model,
    )  # fmt: skip
    return model.T


def guided_coefficients(
    loaded: ctypes.CDLL,
    map_small: Float32,
    guide_small: Float32,
    radius_px: int,
    epsilon: float,
    share: Float32,
) -> tuple[Float32, Float32]:
    """`edge_aware_coefficients`; `share` is one over the pixels of each window."""
    is_same = map_small is guide_small
    guide_small = whole(guide_small)
    map_small = guide_small if is_same else whole(map_small)
    alike(map_small, guide_small, share)
    height, width = guide_small.shape
    scratch = np.empty(4 * (3 * width + 2 * radius_px + 1), np.float64)
    between_a, between_b, a, b = np.empty((4, height, width), np.float32)
    loaded.itmo_guided_coefficients(
        map_small, guide_small, height, width,
        radius_px, epsilon, share, scratch,
        between_a, between_b, a, b,
    )  # fmt: skip
    return a, b


def guide_rows(
    loaded: ctypes.CDLL,
    luma: Codes | Float32,
    levels: tuple[float, float],
    rows: slice,
    small: Float32,
    between: tuple[Indices, Float32],
    *,
    guards: bool,
    edge_aware: bool,
) -> tuple[list[Float32], Float32 | None]:
    """`guidance.Guidance.rows` of the coefficients `small` (planes, h, w): the maps and the ratio.

    `luma` is the complete picture's, (H, W), with black at code `levels[0]` and white `levels[1]`
    above it; `between` gives for each row the row of `small` above it, and the weight of the one
    below. With `guards` the first two planes are those of the ratio. The result does not depend on
    strips.
    """
    above, parts = between
    luma, small = in_lines(luma), whole(small)
    alike(above, parts)
    check_rows(slice(rows.start, rows.start + len(above)), luma)
    count, (planes, h, w), (height, width) = len(above), small.shape, luma.shape
    columns, shares = columns_between(w, width)
    ratio = np.empty((count, width), np.float32) if guards else None
    maps = np.empty(((planes - 2 * guards) // (1 + edge_aware), count, width), np.float32)
    scratch = np.empty(
        2 * planes * (w + 1) + 5 * width + (planes + 2) * (width + 2 * AT_ONCE) + 2 * AT_ONCE,
        np.float32,
    )
    black, span = levels
    loaded.itmo_guide_rows(
        luma, luma.strides[0], luma.itemsize, 1 / span, -black / span,
        height, rows.start, count, width,
        small, planes, h, w,
        above, parts, columns, shares,
        guards, edge_aware, scratch,
        ratio, maps,
    )  # fmt: skip
    return list(maps), ratio


def gain_banterle2006(
    loaded: ctypes.CDLL, luminance: Float32, slope: float, factor: float
) -> Float32:
    """A new array, `factor` / (sqrt(rest^2 + slope * luminance) + rest), rest 1 - luminance."""
    luminance = whole(luminance)
    out = np.empty_like(luminance)
    loaded.itmo_gain_banterle2006(luminance, slope, factor, out.size, out)
    return out


def expand(
    loaded: ctypes.CDLL,
    rgb: Sequence[Float32],
    gain: Float32,
    weight: Float32,
    base: float,
    strength: float,
    out: Half,
) -> None:
    """Write three planes times 1 + strength * (base + weight * (gain - base) - 1) to `out` (half).

    All planes have one shape; `out` has three. Rounded to the nearest half; overflow becomes
    infinity.
    """
    gain, weight = whole(gain), whole(weight)
    alike(*rgb, gain, weight, *out)
    loaded.itmo_expand(
        *rgb, gain, weight,
        base, strength, 1 + strength * (base - 1), gain.size,
        *out,
    )  # fmt: skip


@functools.lru_cache(maxsize=8)
def columns_between(small_width: int, width: int) -> tuple[npt.NDArray[np.int32], Float32]:
    """The small column right of each column's centre, and its weight; padded by AT_ONCE."""
    x = (np.arange(width + AT_ONCE) + 0.5) * (small_width / width) - 0.5
    left = np.floor(x)
    columns = np.minimum(left + 1, small_width).astype(np.int32)
    return columns, (x - left).astype(np.float32)
