"""From a decoded picture to upright planes of integer codes; accesses no files.

Codes are kept as stored: swscale only unpacks rare formats to a planar one of the same kind, and
never converts Y'CbCr to RGB, in which it has a bias.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from itmo_video.colour.chroma import upsample_chroma
from itmo_video.errors import AlreadyHdrError, InputError, ItmoError
from itmo_video.model import ChromaSiting, Code, Encoding, Family

Turn = tuple[int, bool]  # degrees clockwise, mirrored left-right first


@dataclass(frozen=True)
class Picture:
    """A decoded picture's planes as stored, not yet upright."""

    family: Family
    bit_depth: int
    has_alpha: bool
    planes: tuple[Code, ...]


_PLANAR = re.compile(r"(yuvj?|yuva|gbrp|gbrap|gray)(?:4\d\dp|)(9|1[0246]|)(le|be|)")
_PACKED_RGB = {
    "rgb24": "rgb", "bgr24": "bgr", "rgba": "rgba", "bgra": "bgra", "argb": "argb",
    "abgr": "abgr", "rgb0": "rgb0", "bgr0": "bgr0", "0rgb": "0rgb", "0bgr": "0bgr",
    "rgb48": "rgb", "bgr48": "bgr", "rgba64": "rgba", "bgra64": "bgra",
    "gray8a": "ga", "ya8": "ga", "ya16": "ga",
}  # fmt: skip
_PACKED_YUV = {"yuyv422": (0, 1, 3), "uyvy422": (1, 0, 2), "yvyu422": (0, 3, 1)}
_SEMI_PLANAR = re.compile(r"(nv|p[024])(12|21|16|24|42|10|12|16)(le|)")


def read_picture(frame: Any) -> Picture:
    """Copy a picture's codes; AlreadyHdrError for floats, InputError for unknown formats.

    Common formats are unpacked here; rare ones by swscale to a planar format of the same kind.
    """
    name = str(frame.format.name)
    if re.search(r"f(16|32)", name):
        raise AlreadyHdrError(f"floating-point pixels ({name}): it is already HDR")
    if name.startswith(("bayer", "xyz")):
        raise InputError(f"pixel format {name} is not supported")
    if name == "pal8":
        indices, palette = frame.to_ndarray()  # the palette's rows are A, R, G, B
        codes = palette[indices]
        has_alpha = bool(codes[..., 0].min() < 255)
        order = (1, 2, 3, 0) if has_alpha else (1, 2, 3)
        return Picture("rgb", 8, has_alpha, tuple(codes[..., i].copy() for i in order))
    base, big = (name[:-2], name.endswith("be")) if name[-2:] in ("le", "be") else (name, False)
    if all(plane.line_size > 0 for plane in frame.planes):  # negative: stored upside down
        if found := _PLANAR.fullmatch(name):
            return _planar(frame, found[1], int(found[2] or 8), big)
        if base in _PACKED_RGB:
            return _packed(frame, _PACKED_RGB[base], 16 if re.search("16|48|64", base) else 8, big)
        if name in _PACKED_YUV:
            return _packed_yuv(frame, _PACKED_YUV[name])
        if _SEMI_PLANAR.fullmatch(name):
            return _semi_planar(frame, name)
    # One thread, as slices of swscale write past their last row, over what others have written.
    picture = read_picture(frame.reformat(format=_unpacked(frame.format), threads=1))
    return _widened(picture, frame.format)


def _widened(picture: Picture, form: Any) -> Picture:
    """RGB of fewer than 8 bits per channel (15 and 16 per pixel), scaled so that white is 255.

    swscale only shifts such codes, so that white would become 248.
    """
    bits = [component.bits for component in form.components]
    if picture.family != "rgb" or picture.bit_depth != 8 or min(bits, default=8) >= 8:
        return picture
    planes = []
    for plane, depth in zip(picture.planes, bits, strict=False):
        codes, top = np.arange(256) >> (8 - depth), 2**depth - 1
        planes.append(np.rint(codes * 255 / top).astype(np.uint8)[plane])
    return replace(picture, planes=(*planes, *picture.planes[len(planes) :]))


def _unpacked(form: Any) -> str:
    """The planar format that can hold a rare packed one."""
    bits = max((component.bits for component in form.components), default=8)
    suffix = "" if bits <= 8 else "10le" if bits == 10 and form.is_rgb else "16le"
    alpha = any(component.is_alpha for component in form.components)
    if form.is_rgb or form.has_palette:
        return ("gbrap" if alpha else "gbrp") + suffix
    if len(form.components) == 1:
        return "gray" + suffix
    return ("yuva444p" if alpha else "yuv444p") + suffix


def _raw(plane: Any, columns: int, bit_depth: int, big: bool = False) -> Code:
    """A plane's values without line padding, as a view if possible."""
    size = 1 if bit_depth == 8 else 2
    rows = np.frombuffer(plane, np.uint8).reshape(-1, plane.line_size)[: plane.height]
    rows = rows[:, : columns * size]
    if size == 1:
        return rows
    return rows.view(">u2").astype(np.uint16) if big else rows.view("<u2")


def _planar(frame: Any, kind: str, bit_depth: int, big: bool) -> Picture:
    order = {"gbrp": (2, 0, 1), "gbrap": (2, 0, 1, 3), "gray": (0,), "yuva": (0, 1, 2, 3)}
    family: Family = "rgb" if kind.startswith("gb") else "grey" if kind == "gray" else "ycbcr"
    planes = [frame.planes[i] for i in order.get(kind, (0, 1, 2))]
    # The decoder's memory, which it reuses once these views are gone; nothing writes to it here.
    codes = tuple(_raw(plane, plane.width, bit_depth, big) for plane in planes)
    return Picture(family, bit_depth, kind in ("yuva", "gbrap"), codes)


def _packed(frame: Any, channels: str, bit_depth: int, big: bool) -> Picture:
    step = len(channels)
    raw = _raw(frame.planes[0], frame.width * step, bit_depth, big)
    grey = channels == "ga"
    wanted = ("g" if grey else "rgb") + ("a" if "a" in channels else "")
    codes = tuple(raw[:, channels.index(channel) :: step].copy() for channel in wanted)
    return Picture("grey" if grey else "rgb", bit_depth, "a" in channels, codes)


def _packed_yuv(frame: Any, places: tuple[int, int, int]) -> Picture:
    across = -(-frame.width // 2)
    raw = _raw(frame.planes[0], across * 4, 8)
    luma, cb, cr = places
    codes = (raw[:, luma::2][:, : frame.width].copy(), raw[:, cb::4].copy(), raw[:, cr::4].copy())
    return Picture("ycbcr", 8, False, codes)


def _semi_planar(frame: Any, name: str) -> Picture:
    bit_depth = 8 if name.startswith("nv") else int(name[2:4])
    luma = _raw(frame.planes[0], frame.width, bit_depth)
    pairs = _raw(frame.planes[1], frame.planes[1].width * 2, bit_depth)
    first, second = (1, 0) if name in ("nv21", "nv42") else (0, 1)
    shift = 0 if bit_depth == 8 else 16 - bit_depth  # P010 and similar use the high bits
    codes = tuple(codes >> shift for codes in (luma, pairs[:, first::2], pairs[:, second::2]))
    return Picture("ycbcr", bit_depth, False, tuple(np.ascontiguousarray(c) for c in codes))


# ---- upright ----

_OFFSETS: dict[ChromaSiting, tuple[float, float]] = {
    "topleft": (0, 0), "top": (0.5, 0), "topright": (1, 0),
    "left": (0, 0.5), "center": (0.5, 0.5), "right": (1, 0.5),
    "bottomleft": (0, 1), "bottom": (0.5, 1), "bottomright": (1, 1),
}  # fmt: skip
_SITINGS = {offsets: siting for siting, offsets in _OFFSETS.items()}


def upright(
    planes: tuple[Code, ...], turn: Turn, encoding: Encoding
) -> tuple[tuple[Code, ...], Encoding]:
    """Mirror and rotate planes for display, along with the chroma siting.

    For 4:1:1, 4:1:0, and odd sizes at which no siting would fit, chroma is first upsampled to full
    size in 16 bits, which is exact for limited range.
    """
    rotation, flip = turn
    if encoding.family == "ycbcr" and _needs_full_chroma(planes, turn):
        planes, encoding = full_chroma(planes, encoding)
    if not rotation and not flip:
        return planes, encoding
    x, y = _OFFSETS[encoding.siting]
    x = 1 - x if flip else x
    for _ in range(rotation // 90):
        x, y = 1 - y, x
    turned = tuple(
        cast(Code, np.ascontiguousarray(np.rot90(p[:, ::-1] if flip else p, -rotation // 90)))
        for p in planes
    )
    return turned, replace(encoding, siting=_SITINGS[x, y])


def _needs_full_chroma(planes: tuple[Code, ...], turn: Turn) -> bool:
    rotation, flip = turn
    # Which of the stored axes are reversed in the end: columns, then rows.
    reversals = flip != (rotation in (180, 270)), rotation in (90, 180)
    for axis, is_reversed in zip((1, 0), reversals, strict=True):
        size, chroma = planes[0].shape[axis], planes[1].shape[axis]
        if chroma * 2 < size or (is_reversed and chroma != size != chroma * 2):
            return True
    return False


def full_chroma(planes: tuple[Code, ...], encoding: Encoding) -> tuple[tuple[Code, ...], Encoding]:
    """Planes with chroma upsampled to the size of luma, in 16 bits."""
    height, width = planes[0].shape
    depth, top = encoding.bit_depth, 2**encoding.bit_depth - 1
    scale = 65535 / top if encoding.range == "full" else 2.0 ** (16 - depth)

    def wide(values: npt.NDArray[Any], factor: float, middle: float = 0) -> Code:
        codes = (values.astype(np.float64) - middle) * factor + middle * 2.0 ** (16 - depth)
        return np.clip(np.round(codes), 0, 65535).astype(np.uint16)

    luma = wide(planes[0], scale)
    chroma = (upsample_chroma(p, (width, height), encoding.siting) for p in planes[1:3])
    cb, cr = (wide(p, scale, 2.0 ** (depth - 1)) for p in chroma)
    alpha = tuple(wide(p, 65535 / top) for p in planes[3:])
    return (luma, cb, cr, *alpha), replace(encoding, bit_depth=16)


def is_420(form: Any) -> bool:
    """Whether a pixel format's chroma is halved in both directions."""
    return bool((form.chroma_width(2), form.chroma_height(2)) == (1, 1))


def pixel_form(frame: Any) -> str:
    """The pixel format's name, without the j of full-range variants."""
    return str(frame.format.name).replace("yuvj", "yuv")


def picture_of(path: Path, decoded: Any) -> Picture:
    """Read a picture, with the file named in errors."""
    try:
        return read_picture(decoded)
    except ItmoError as error:
        raise type(error)(error.what, where=str(path), remedy=error.remedy) from error
