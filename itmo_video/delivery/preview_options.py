"""The options of `preview`: how it looks and how it is encoded."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

from itmo_video.delivery.choices import (
    AVIF_CRF,
    DEFAULT_CRF,
    DEFAULT_SPEED,
    Chroma,
    Codec,
    Depth,
    Layout,
    Scale,
    View,
)
from itmo_video.errors import UsageError
from itmo_video.options import check_options, flag_of, option

OF_VIEW = (
    "view", "frame", "tone_map", "display_peak", "exposure", "layout", "wipe_at",
    "hdr_compare", "no_labels", "scale", "clip",
)  # fmt: skip
_OF_ONE_VIEW = {
    "layout": "compare", "wipe_at": "compare", "hdr_compare": "compare", "scale": "false-colour",
}  # fmt: skip
OF_ENCODING = ("no_audio", "codec", "chroma", "depth", "crf", "speed")


@dataclass(frozen=True)
class PreviewOptions:
    """How a preview looks and is encoded; `frame` (a number as in file names) selects a still.

    Validated on creation; raises UsageError.

    >>> from itmo_video import PreviewOptions
    >>> PreviewOptions(view="hlg", codec="hevc", crf="high").tone_map
    'bt2390'
    """

    view: View | None = option(
        None, str, "what to show: HDR10 or HLG; for SDR monitors sdr, compare (SDR beside HDR), "
        "false-colour, ladder (three exposures); ACES 2.0's SDR or HDR; log for grading "
        "(hdr10; a JPEG is SDR with a gain map)",
        flag="as",
        choices=get_args(View),
    )  # fmt: skip
    frame: int | None = option(None, int, "write a still of this frame", lower=0, metavar="N")
    tone_map: str = option(
        "bt2390", str, "tone mapping operator of SDR views",
        choices=("bt2390", "reinhard", "hable", "aces", "clip"),
    )  # fmt: skip
    display_peak: float | None = option(
        None, float, "hdr10: tone-map for a display with this peak in nits (BT.2390)",
        lower=50, upper=10000, metavar="N",
    )  # fmt: skip
    exposure: float = option(
        0.0, float, "exposure of sdr, compare and aces, before tone mapping", lower=-20, upper=20,
        metavar="STOPS",
    )  # fmt: skip
    layout: Layout = option(
        "side", str, "layout of compare: side by side, or a wipe", choices=get_args(Layout)
    )
    wipe_at: float = option(0.5, float, "position of the wipe", lower=0, upper=1, metavar="X")
    hdr_compare: bool = option(
        False, bool, "encode compare as HDR10 instead of tone-mapping it", flag="in-hdr"
    )
    no_labels: bool = option(False, bool, "no labels in compare")
    scale: Scale = option(
        "stops",
        str,
        "scale of false colour: half stops around SDR white, or round nits",
        choices=get_args(Scale),
    )
    clip: Path | None = option(
        None,
        Path,
        "source clip of a converted folder, for sound and compare",
        flag="source",
        metavar="CLIP",
    )
    no_audio: bool = option(False, bool, "no sound")
    codec: Codec = option(
        "av1", str, "codec of a film; the last three are for grading, in .mov",
        choices=get_args(Codec),
    )  # fmt: skip
    chroma: Chroma | None = option(
        None, str, "chroma subsampling (default: by the codec)", choices=get_args(Chroma)
    )
    depth: Depth = option(
        "10", str, "bit depth of y4m; 8 for SDR views only", choices=get_args(Depth)
    )
    crf: float | Literal["high"] | None = option(
        None, float,
        f"quality, 0 (best) to 63 (defaults: av1 {DEFAULT_CRF['av1']}, hevc {DEFAULT_CRF['hevc']} "
        f"of 51, AVIF {AVIF_CRF}), or `high`: median error of nits within 2 %",
        lower=0, upper=63, words=("high",), metavar="Q", aliases=("quality",),
    )  # fmt: skip
    speed: str | None = option(
        None,
        str,
        f"encoder preset (av1: 0 slow to 13 fast, default {DEFAULT_SPEED['av1']}; "
        f"hevc: default {DEFAULT_SPEED['hevc']})",
        metavar="PRESET",
    )
    hdr10plus: Path | None = option(
        None,
        Path,
        "hdr10: put HDR10+ metadata of `analyse --hdr10plus` into the stream (av1, hevc)",
        metavar="FILE.json",
    )

    def __post_init__(self) -> None:
        check_options(self)
        for f in dataclasses.fields(self):
            view = _OF_ONE_VIEW.get(f.name)
            if view and self.view != view and getattr(self, f.name) != f.default:
                raise UsageError(f"{flag_of(f)} applies to --as {view} only", remedy="Omit it.")
        if self.hdr_compare and self.tone_map != "bt2390":
            raise UsageError("--in-hdr does not tone-map", remedy="Omit --tone-map.")
