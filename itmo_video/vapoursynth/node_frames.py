"""A VapourSynth clip as a source of frames: validated, read by its frame properties."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from fractions import Fraction
from typing import Any, cast

import numpy as np
import vapoursynth as vs

from itmo_video.errors import AlreadyHdrError, UsageError
from itmo_video.model import ASSUMED_SEQUENCE_RATE, ChromaSiting, Code, Encoding, Family, Frame
from itmo_video.settings import Settings
from itmo_video.source.files import MAX_PIXELS
from itmo_video.source.opening import input_options
from itmo_video.source.tags import Tags, resolve_encoding

WHERE = "the VapourSynth clip"
_OF_FILES = ("deinterlace", "fps", "stream", "raw", "layers")
_FAMILIES: dict[int, Family] = {int(vs.YUV): "ycbcr", int(vs.RGB): "rgb", int(vs.GRAY): "grey"}
_SITINGS: tuple[ChromaSiting, ...] = ("left", "center", "topleft", "top", "bottomleft", "bottom")
_HALVED = {(0, 0), (1, 0), (1, 1)}  # 4:4:4, 4:2:2, 4:2:0


class NodeFrames:
    """A clip's frames by number, as codes. `notices` says what is assumed.

    The first frame's properties say how codes are read (`_Matrix`, `_Transfer`, `_Range`,
    `_Primaries`, `_ChromaLocation`) unless the settings do.
    """

    def __init__(self, node: Any, settings: Settings) -> None:
        """Raises UsageError for unsupported clips and settings, AlreadyHdrError for HDR."""
        plain = Settings()
        for name in _OF_FILES:
            if getattr(settings, name) != getattr(plain, name):
                raise UsageError(f"{name} does not apply to VapourSynth clips", remedy="Omit it.")
        _check_format(node)
        self._node = node
        self._rate = Fraction(node.fps) or ASSUMED_SEQUENCE_RATE  # 0 where it varies
        with node.get_frame(0) as first:
            self._encoding, self.notices = _encoding(node, dict(first.props), settings)

    def frames(self, start: int = 0) -> Iterator[Frame]:
        """Yield the frames from `start` on, each requested from VapourSynth when needed."""
        planes = range(self._node.format.num_planes)
        for index in range(start, self._node.num_frames):
            with self._node.get_frame(index) as frame:
                codes = cast(tuple[Code, ...], tuple(np.array(frame[plane]) for plane in planes))
            yield Frame(index, index / self._rate, codes, self._encoding)


def _check_format(node: Any) -> None:
    form = node.format
    if form is None or not form.num_planes or not node.width:
        raise UsageError("the format or size varies", where=WHERE, remedy="Convert it first.")
    if form.sample_type != vs.INTEGER:
        raise AlreadyHdrError(
            f"the pixels are floating-point ({form.name})", where=WHERE,
            remedy="Pass codes: core.resize.Bicubic(clip, format=vs.YUV444P16) or RGB48.",
        )  # fmt: skip
    if form.bits_per_sample > 16 or (form.subsampling_w, form.subsampling_h) not in _HALVED:
        raise UsageError(
            f"{form.name} is not supported", where=WHERE,
            remedy="Convert it to 4:2:0, 4:2:2 or 4:4:4 with at most 16 bits by core.resize.",
        )  # fmt: skip


def _encoding(
    node: Any, props: Mapping[str, Any], settings: Settings
) -> tuple[Encoding, tuple[str, ...]]:
    if int(props.get("_FieldBased", 0)):
        raise UsageError(
            "the clip is interlaced (_FieldBased)", where=WHERE,
            remedy="Deinterlace it first; if only the flag is wrong, use core.std.SetFieldBased.",
        )  # fmt: skip
    family = _FAMILIES[int(node.format.color_family)]
    tags = Tags(
        int(props.get("_Matrix", 2)), _range(props, family), int(props.get("_Transfer", 2)),
        int(props.get("_Primaries", 2)),
    )  # fmt: skip
    encoding, notices = resolve_encoding(
        tags, input_options(settings, MAX_PIXELS),
        family=family, bit_depth=node.format.bits_per_sample, has_alpha=False,
        is_full_format=False, is_still=False, codec="vapoursynth", size=(node.width, node.height),
        where=WHERE,
    )  # fmt: skip
    siting = int(props.get("_ChromaLocation", 0))
    return replace(encoding, siting=_SITINGS[siting]), notices


def _range(props: Mapping[str, Any], family: Family) -> int:
    """FFmpeg's number for the range; VapourSynth's grey is luma, limited unless flagged."""
    if "_Range" in props:
        return 2 if int(props["_Range"]) else 1
    return 1 if family == "grey" else 0
