"""What a stream's tags mean: matrix, range, transfer, primaries, siting, orientation, formats.

The enumerations are FFmpeg's, which follow ITU-T H.273.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from itmo_video.errors import AlreadyHdrError, InputError
from itmo_video.model import (
    ChromaSiting,
    Code,
    Encoding,
    Family,
    Matrix,
    Origin,
    Primaries,
    Range,
    Transfer,
)

MATRICES: dict[int, Matrix] = {1: "bt709", 5: "bt601", 6: "bt601", 4: "bt601", 9: "bt2020"}
TRANSFERS: dict[int, Transfer] = {
    1: "bt1886", 6: "bt1886", 7: "bt1886", 14: "bt1886", 15: "bt1886",
    13: "srgb", 4: "gamma22", 8: "linear", 16: "pq", 18: "hlg",
}  # fmt: skip
PRIMARIES: dict[int, Primaries] = {
    1: "rec709", 5: "rec601_625", 6: "rec601_525", 7: "rec601_525", 9: "rec2020", 12: "p3d65",
}  # fmt: skip
HD_LINES = 720  # untagged pictures from this height up are taken for BT.709


@dataclass(frozen=True)
class InputOptions:
    """How the user says that an input is to be read; "auto" goes by its tags."""

    transfer: str = "auto"
    matrix: str = "auto"
    range: str = "auto"
    force_sdr: bool = False
    deinterlace: str = "auto"
    max_pixels: int = 2**27


@dataclass(frozen=True)
class Native:
    """A planar pixel format that is read without swscale's colour conversion.

    `order` lists the decoder's planes as (Y, Cb, Cr), (R, G, B) or (Y,), then A.
    """

    name: str
    family: Family
    bit_depth: int
    order: tuple[int, ...]
    has_alpha: bool = False


def native_format(name: str) -> Native:
    """The planar format to read `name` as; InputError for formats that are not understood."""
    suffix = next((s for s in ("9le", "10le", "12le", "14le", "16le") if name.endswith(s)), "")
    base, depth = name.removesuffix(suffix), int(suffix.removesuffix("le") or 8)
    for prefix, family, order in (
        ("yuva4", "ycbcr", (0, 1, 2, 3)),
        ("yuvj4", "ycbcr", (0, 1, 2)),
        ("yuv4", "ycbcr", (0, 1, 2)),
        ("gbrap", "rgb", (2, 0, 1, 3)),
        ("gbrp", "rgb", (2, 0, 1)),
        ("gray", "grey", (0,)),
    ):
        if base.startswith(prefix) and "f32" not in name and "f16" not in name and "be" not in name:
            alpha = prefix in ("yuva4", "gbrap")
            return Native(name, cast(Family, family), depth, order, alpha)
    lossless = {
        "nv12": "yuv420p", "nv21": "yuv420p", "uyvy422": "yuv422p", "yuyv422": "yuv422p",
        "p010le": "yuv420p10le", "p016le": "yuv420p16le", "y210le": "yuv422p10le",
        "nv16": "yuv422p", "uyyvyy411": "yuv411p", "ya8": "gbrap", "ya16le": "gbrap16le",
        "ya16be": "gbrap16le", "gray16be": "gray16le", "monob": "gray", "monow": "gray",
        "vuya": "yuva444p", "ayuv64le": "yuva444p16le", "vuyx": "yuv444p",
    }  # fmt: skip
    if name in lossless:
        return native_format(lossless[name])
    if "f32" in name or "f16" in name:
        raise AlreadyHdrError(f"its pixels are floating-point ({name})")
    if any(part in name for part in ("rgb", "bgr", "gbr", "pal8")):
        wide = any(part in name for part in ("48", "64", "16be", "x2", "10be", "12be", "14be"))
        alpha = any(
            part in name for part in ("rgba", "bgra", "argb", "abgr", "64", "pal8", "gbrap")
        )
        return native_format(("gbrap" if alpha else "gbrp") + ("16le" if wide else ""))
    if name.startswith("yuv") and name.endswith("be"):
        return native_format(name.removesuffix("be") + "le")
    raise InputError(f"its pixel format {name} is not understood")


def resolve_encoding(context: Any, frame: Any, options: InputOptions, where: str) -> Encoding:
    """How the codes are to be read: by the user's word, the tags, or what is usual.

    Raises AlreadyHdrError for PQ, HLG, linear and floating-point sources.
    """
    try:
        native = native_format(frame.format.name)
    except (AlreadyHdrError, InputError) as error:
        raise type(error)(error.what, where=where) from error
    origins: dict[str, Origin] = {}

    def choose(name: str, chosen: str, tagged: str | None, usual: str) -> str:
        if chosen != "auto":
            origins[name] = "set"
            return chosen
        origins[name] = "tag" if tagged else "assumed"
        return tagged or usual

    is_still = str(context.name) in ("png", "mjpeg", "tiff", "webp", "bmp", "apng", "gif")
    is_ycbcr = native.family == "ycbcr"
    tag = {
        name: int(getattr(frame, name, 0) or 0) or int(getattr(context, name, 0) or 0)
        for name in ("colorspace", "color_range", "color_trc", "color_primaries")
    }
    size_matrix = "bt709" if frame.height >= HD_LINES and not is_still else "bt601"
    matrix = choose("matrix", options.matrix, MATRICES.get(tag["colorspace"]), size_matrix)
    full = "yuvj" in str(context.pix_fmt) or not is_ycbcr
    tagged_range = {1: "limited", 2: "full"}.get(tag["color_range"])
    if not is_ycbcr and native.family == "rgb":
        tagged_range = None  # RGB is full range; a "limited" tag on it is left to the user
    range_ = choose("range", options.range, tagged_range, "full" if full else "limited")
    usual = "bt1886" if is_ycbcr and not is_still else "srgb"
    tagged_transfer = TRANSFERS.get(tag["color_trc"])
    transfer = choose(
        "transfer", "bt1886" if options.force_sdr and options.transfer == "auto" and tagged_transfer
        in ("pq", "hlg", "linear") else options.transfer, tagged_transfer, usual,
    )  # fmt: skip
    if options.transfer == "auto" and transfer in ("pq", "hlg", "linear"):
        kinds = {"pq": "PQ (HDR10)", "hlg": "HLG", "linear": "linear light"}
        raise AlreadyHdrError(
            f"it is tagged as {kinds[transfer]}, so it is HDR already",
            where=where,
            remedy="If the tag is wrong, say what it is: --transfer bt1886, or --force-sdr.",
        )
    primaries = choose("primaries", "auto", PRIMARIES.get(tag["color_primaries"]), "rec709")
    return Encoding(
        family=native.family,
        bit_depth=native.bit_depth,
        matrix=cast(Matrix, matrix),
        range=cast(Range, range_),
        transfer=cast(Transfer, transfer),
        primaries=cast(Primaries, primaries),
        siting=_siting(context, matrix),
        has_alpha=native.has_alpha,
        origins=origins,
    )


def _siting(context: Any, matrix: str) -> ChromaSiting:
    # PyAV does not show chroma_location, so the codec's convention is taken.
    if str(context.name) in ("mpeg1video", "mjpeg", "webp", "vp8"):
        return "center"
    return "topleft" if matrix == "bt2020" and "hevc" in str(context.name) else "left"


def orientation(frame: Any) -> tuple[int, bool]:
    """(degrees clockwise, mirrored first) that turn a decoded frame upright."""
    rotation = round(float(getattr(frame, "rotation", 0) or 0))
    return (-rotation) % 360, False


def orient(
    planes: tuple[Code, ...], turn: tuple[int, bool], encoding: Encoding
) -> tuple[Code, ...]:
    """The planes upright: mirrored if asked, then turned clockwise."""
    rotation, flip = turn
    if not rotation and not flip:
        return planes
    out: list[Code] = []
    for plane in planes:
        upright = plane[:, ::-1] if flip else plane
        out.append(cast(Code, np.ascontiguousarray(np.rot90(upright, -rotation // 90))))
    return tuple(out)


def field_order(context: Any) -> str:
    """Interlacing as the codec says: "progressive", "interlaced" or "unknown"."""
    value = str(getattr(context, "field_order", "") or "unknown").lower()
    if value in ("1", "progressive"):
        return "progressive"
    return "unknown" if value in ("0", "unknown", "none") else "interlaced"


def timecode(container: Any, stream: Any) -> str | None:
    """The start timecode from the metadata, if any."""
    found = stream.metadata.get("timecode") or container.metadata.get("timecode")
    return str(found) if found else None


def notices(context: Any, encoding: Encoding) -> tuple[str, ...]:
    """What the user should know about how the clip is read."""
    told = [
        f"{name} is not tagged: assumed {getattr(encoding, name)}"
        for name, origin in encoding.origins.items()
        if origin == "assumed" and not (name == "matrix" and encoding.family != "ycbcr")
    ]
    if field_order(context) == "interlaced":
        told.append("it is flagged as interlaced")
    return tuple(told)
