"""How a preview looks and is encoded: the options of `preview`."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from itmo_video.errors import UsageError
from itmo_video.options import check_options, flag_of, option

View = Literal[
    "hdr10", "hlg", "sdr", "compare", "false-colour", "ladder", "aces", "aces-hdr", "acescct",
    "logc3",
]  # fmt: skip
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
    """How a preview looks and is encoded; `frame` (a number as in file names) asks for a still.

    Validated when made; raises UsageError.

    >>> from itmo_video import PreviewOptions
    >>> PreviewOptions(view="hlg", codec="hevc", crf="high").tone_map
    'bt2390'
    """

    view: View | None = option(
        None, str, "what to show (hdr10; a JPEG then is SDR with a gain map)", flag="as",
        choices=(
            "hdr10", "hlg", "sdr", "compare", "false-colour", "ladder", "aces", "aces-hdr",
            "acescct", "logc3",
        ),
    )  # fmt: skip
    frame: int | None = option(
        None, int, "a still of this frame, by its number", lower=0, metavar="N"
    )
    tone_map: str = option(
        "bt2390", str, "how HDR is brought back to SDR",
        choices=("bt2390", "reinhard", "hable", "aces", "clip"),
    )  # fmt: skip
    display_peak: float | None = option(
        None, float, "of hdr10: map to a display of this peak in nits by BT.2390's EETF",
        lower=50, upper=10000, metavar="N",
    )  # fmt: skip
    exposure: float = option(
        0.0, float, "of sdr, compare and aces, in stops, before the tone map", lower=-20, upper=20,
        metavar="STOPS",
    )  # fmt: skip
    layout: Literal["side", "wipe"] = option(
        "side", str, "of compare: side by side, or a wipe", choices=("side", "wipe")
    )
    wipe_at: float = option(0.5, float, "where the wipe is", lower=0, upper=1, metavar="X")
    hdr_compare: bool = option(
        False, bool, "compare as an HDR10 film instead of tone-mapped", flag="in-hdr"
    )
    no_labels: bool = option(False, bool, "leave the names of both sides out of compare")
    scale: Literal["stops", "nits"] = option(
        "stops",
        str,
        "false colour in half stops about SDR white, or in round nits",
        choices=("stops", "nits"),
    )
    clip: Path | None = option(
        None, Path, "a folder's source: sound, compare", flag="source", metavar="CLIP"
    )
    no_audio: bool = option(False, bool, "leave the source's sound out of the film")
    codec: Literal["av1", "hevc", "prores", "prores4444", "dnxhr"] = option(
        "av1", str, "of a film; the last three are for grading, in .mov",
        choices=("av1", "hevc", "prores", "prores4444", "dnxhr"),
    )  # fmt: skip
    chroma: Literal["420", "422", "444"] | None = option(
        None, str, "4:2:0, 4:2:2 or 4:4:4 (by the codec; av1 has 4:2:0)",
        choices=("420", "422", "444"),
    )  # fmt: skip
    depth: Literal["8", "10"] = option(
        "10", str, "bits of y4m, 8 for SDR views only", choices=("8", "10")
    )
    crf: float | Literal["high"] | None = option(
        None, float,
        "0 best to 63 (av1: 25, hevc: 18 of 51, AVIF: 12), or `high`: pixels are the EXRs' "
        "nits within 2 % in the median",
        lower=0, upper=63, words=("high",), metavar="Q", aliases=("quality",),
    )  # fmt: skip
    speed: str | None = option(
        None, str, "the encoder's preset (av1: 5 of 0 slow to 13; hevc: fast)", metavar="PRESET"
    )

    def __post_init__(self) -> None:
        check_options(self)
        for f in dataclasses.fields(self):
            view = _OF_ONE_VIEW.get(f.name)
            if view and self.view != view and getattr(self, f.name) != f.default:
                raise UsageError(f"{flag_of(f)} is for --as {view} only", remedy="Leave it out.")
        if self.hdr_compare and self.tone_map != "bt2390":
            raise UsageError("in-hdr shows HDR as it is", remedy="Leave --tone-map out.")
