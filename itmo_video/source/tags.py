"""Interpreting a file's tags: matrix, range, transfer, primaries, siting and orientation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import atan2, degrees
from typing import Any, cast

import numpy as np

from itmo_video.errors import AlreadyHdrError, InputError
from itmo_video.model import (
    ChromaSiting,
    Encoding,
    Family,
    Matrix,
    Origin,
    Primaries,
    Range,
    Transfer,
)
from itmo_video.source.files import MAX_PIXELS

HD_WIDTH, SD_LINES = 1280, 576  # untagged: BT.709 from this width or above this height

# FFmpeg's numbers, which are those of ITU-T H.273.
_MATRICES: dict[int, Matrix] = {
    1: "bt709", 4: "bt601", 5: "bt601", 6: "bt601", 7: "bt709", 9: "bt2020", 10: "bt2020",
}  # fmt: skip
_NEAR_MATRICES = {4: "FCC", 7: "SMPTE 240M", 10: "BT.2020 constant luminance"}
_OTHER_MATRICES = {8: "YCgCo", 11: "YDzDx", 12: "derived", 13: "derived", 14: "ICtCp", 15: "IPT"}
_TRANSFERS: dict[int, Transfer] = {
    1: "bt1886", 4: "gamma22", 5: "bt1886", 6: "bt1886", 7: "bt1886", 8: "linear", 11: "bt1886",
    12: "bt1886", 13: "srgb", 14: "bt1886", 15: "bt1886", 16: "pq", 18: "hlg", 9: "log", 10: "log",
}  # fmt: skip
_HDR_TRANSFERS = {
    8: "linear light", 9: "logarithmic", 10: "logarithmic", 16: "PQ (HDR10)", 17: "SMPTE 428",
    18: "HLG",
}  # fmt: skip
_PRIMARIES: dict[int, Primaries] = {
    1: "rec709", 5: "rec601_625", 6: "rec601_525", 7: "rec601_525", 9: "rec2020", 11: "p3d65",
    12: "p3d65", 22: "rec601_625",
}  # fmt: skip
_OTHER_PRIMARIES = {4: "BT.470 M", 8: "generic film", 10: "XYZ"}
_XYZ = 10  # primaries of SMPTE 428
_RANGES: dict[int, Range] = {1: "limited", 2: "full"}


@dataclass(frozen=True)
class InputOptions:
    """How an input is to be read; "auto" follows its tags.

    `stream` is a video stream's number in the file. With `only_tells` HDR is not refused: the clip
    is opened for its metadata only.
    """

    transfer: str = "auto"
    matrix: str = "auto"
    range: str = "auto"
    force_sdr: bool = False
    deinterlace: str = "auto"
    max_pixels: int = MAX_PIXELS
    fps: Fraction | None = None
    stream: int | None = None
    raw: str | None = None
    only_tells: bool = False


@dataclass(frozen=True)
class Tags:
    """Colour tags as FFmpeg's numbers (2 or 0: unspecified), or what a profile names."""

    matrix: int = 2
    range: int = 0
    transfer: int = 2
    primaries: int = 2
    named_transfer: Transfer | None = None
    named_primaries: Primaries | None = None


def read_tags(frame: Any, context: Any = None) -> Tags:
    """A decoded frame's tags; where it has none, its stream's."""

    def first(name: str, unknown: tuple[int, ...]) -> int:
        values = [int(getattr(owner, name)) for owner in (frame, context) if owner is not None]
        return next((v for v in values if v not in unknown), unknown[0])

    return Tags(
        first("colorspace", (2,)),
        first("color_range", (0,)),
        first("color_trc", (2, 0)),
        first("color_primaries", (2, 0)),
    )


def resolve_encoding(
    tags: Tags,
    options: InputOptions,
    *,
    family: Family,
    bit_depth: int,
    has_alpha: bool,
    is_full_format: bool,
    is_still: bool,
    codec: str,
    size: tuple[int, int],
    where: str,
    siting: ChromaSiting | None = None,
    is_420: bool = False,
) -> tuple[Encoding, tuple[str, ...]]:
    """Decide how codes are read, by the settings, the tags or conventions, with notices.

    `siting` is the stated one of chroma, which counts for 4:2:0 (`is_420`).

    Raises AlreadyHdrError for PQ, HLG, linear and log tags that the user does not override, and
    InputError for a matrix that is not Y'CbCr.
    """
    origins: dict[str, Origin] = {}
    told: list[str] = []
    assumed: list[str] = []
    unread: dict[str, str] = {}
    if tags.primaries not in (0, 2, *_PRIMARIES) and tags.named_primaries is None:
        unread["primaries"] = _OTHER_PRIMARIES.get(tags.primaries, f"number {tags.primaries}")
    if tags.transfer not in (0, 2, *_TRANSFERS, *_HDR_TRANSFERS) and tags.named_transfer is None:
        unread["transfer"] = f"number {tags.transfer}"

    def choose(name: str, chosen: str, tagged: str | None, usual: str) -> str:
        origins[name] = "set" if chosen != "auto" else "tag" if tagged else "assumed"
        result = chosen if chosen != "auto" else tagged or usual
        if name in unread:
            if origins[name] == "assumed":
                told.append(f"{name} tagged as {unread[name]}: not supported, read as {result}")
        elif origins[name] == "assumed" and (name not in ("matrix", "range") or family == "ycbcr"):
            assumed.append(f"{name} {result}")
        return result

    set_transfer = options.transfer
    if tags.transfer in _HDR_TRANSFERS and set_transfer == "auto" and options.only_tells:
        told.append(f"tagged as {_HDR_TRANSFERS[tags.transfer]}: it is already HDR")
    elif tags.transfer in _HDR_TRANSFERS and set_transfer == "auto":
        if not options.force_sdr:
            raise AlreadyHdrError(
                f"tagged as {_HDR_TRANSFERS[tags.transfer]}: it is already HDR",
                where=where,
                remedy="If the tag is wrong, use --transfer bt1886 or --force-sdr.",
            )
        set_transfer = "bt1886"
    if tags.primaries == _XYZ and set_transfer == "auto" and not options.only_tells:
        raise InputError(
            "primaries are tagged as XYZ (SMPTE 428), so the codes are not RGB",
            where=where,
            remedy="Convert it to RGB first; if the tag is wrong, use --transfer bt1886.",
        )
    if family == "ycbcr" and options.matrix == "auto" and tags.matrix in _OTHER_MATRICES:
        raise InputError(
            f"matrix {_OTHER_MATRICES[tags.matrix]} is not supported",
            where=where,
            remedy="If the tag is wrong, use --matrix bt709.",
        )
    if tags.matrix in _NEAR_MATRICES and family == "ycbcr" and options.matrix == "auto":
        told.append(f"matrix {_NEAR_MATRICES[tags.matrix]} is read as {_MATRICES[tags.matrix]}")
    is_hd = size[0] >= HD_WIDTH or size[1] > SD_LINES  # mpv's rule, and so of most players
    usual_matrix = "bt709" if is_hd and codec != "mjpeg" and not is_still else "bt601"
    is_full = family != "ycbcr" or is_full_format
    # A limited-range tag on RGB or grey images is nearly always an unintended default.
    range_tag = None if family == "rgb" or (family == "grey" and is_still) else tags.range
    encoding = Encoding(
        family=family,
        bit_depth=bit_depth,
        matrix=cast(
            Matrix, choose("matrix", options.matrix, _MATRICES.get(tags.matrix), usual_matrix)
        ),
        range=cast(
            Range,
            choose(
                "range",
                options.range,
                _RANGES.get(range_tag or (2 if is_full_format else 0)),
                "full" if is_full else "limited",
            ),
        ),
        transfer=cast(
            Transfer,
            choose(
                "transfer",
                set_transfer,
                _TRANSFERS.get(tags.transfer, tags.named_transfer),
                "srgb" if is_still or family == "rgb" else "bt1886",
            ),
        ),
        primaries=cast(
            Primaries,
            choose(
                "primaries", "auto", _PRIMARIES.get(tags.primaries, tags.named_primaries), "rec709"
            ),
        ),
        siting=siting or _siting(codec),
        has_alpha=has_alpha,
        origins=origins,
    )
    if is_420:
        origins["siting"] = "assumed" if siting is None else "tag"
        assumed += [f"chroma siting {encoding.siting}"] if siting is None else []
    if assumed:
        told.append(f"not tagged, so assumed: {', '.join(assumed)}")
    return encoding, tuple(told)


def _siting(codec: str) -> ChromaSiting:
    """The codec's convention, where nothing states it."""
    if codec == "dvvideo":
        return "topleft"
    return "center" if codec in ("mpeg1video", "mjpeg", "webp", "vp8", "theora") else "left"


# ---- orientation ----


def matrix_turn(matrix: Sequence[int]) -> tuple[int, bool]:
    """(degrees clockwise, mirrored left-right first) from a display matrix's nine integers.

    Other angles are rounded to the nearest right angle (ISO/IEC 14496-12, 6.2.2).
    """
    a, b, _, c, d = (float(value) for value in matrix[:5])
    flip = a * d - b * c < 0
    angle = degrees(atan2(-b, -a) if flip else atan2(b, a))
    return round(angle / 90) % 4 * 90, flip


def frame_turn(frame: Any) -> tuple[int, bool]:
    """(degrees clockwise, mirrored first) that make a decoded frame upright."""
    try:
        for index in range(len(frame.side_data)):  # iteration yields keys from PyAV 19 on
            side = frame.side_data[index]
            if side.type.name == "DISPLAYMATRIX":
                return matrix_turn(np.frombuffer(bytes(side), np.int32).tolist())
    except ValueError:  # PyAV 18 does not know every kind of side data
        return round(-frame.rotation / 90) % 4 * 90, False
    return 0, False
