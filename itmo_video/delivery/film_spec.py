"""The encoding of a film: codec, signal and sizes, and checks of their combinations."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Literal

from itmo_video.delivery import metadata
from itmo_video.delivery.choices import Chroma, Codec
from itmo_video.errors import UsageError

Signal = Literal["pq", "hlg", "sdr", "acescct", "logc3"]

MASTERS: dict[str, tuple[Chroma, ...]] = {  # for grading: intraframe, fixed quality
    "prores": ("422",),
    "prores4444": ("444",),
    "dnxhr": ("422", "444"),
}
KEEPS_ALPHA = "prores4444"  # FFmpeg's DNxHR has none
_NAMES = {"prores": "ProRes 422 HQ", "prores4444": "ProRes 4444", "dnxhr": "DNxHR"}
# The encoders' minimum sizes. SVT-AV1 accepts 4, but never ends if one side is up to 24 and the
# other above 64.
_LEAST = {"dnxhr": (256, 120), "hevc": (16, 16), "av1": (32, 32)}

MUXERS = {".mp4": "mp4", ".m4v": "mp4", ".mov": "mov", ".mkv": "matroska"}
HIGH_CRF: dict[str, float] = {"av1": 1, "hevc": 1}  # median error within 2 %, also in the dark
SPEEDS: dict[str, tuple[str, ...]] = {
    "av1": tuple(map(str, range(14))),
    "hevc": (
        "ultrafast", "superfast", "veryfast", "faster", "fast", "medium", "slow", "slower",
        "veryslow", "placebo",
    ),
}  # fmt: skip


@dataclass(frozen=True)
class FilmSpec:
    """The encoding of a film: sizes in pixels (even), times in seconds, light in nits."""

    width: int
    height: int
    frame_rate: Fraction
    time_base: Fraction
    pixel_aspect: Fraction
    signal: Signal
    codec: Codec = "av1"
    chroma: Chroma = "420"
    peak_nits: float = 1000.0
    crf: float | None = None
    speed: str | None = None
    has_alpha: bool = False

    @property
    def mastering(self) -> metadata.Mastering:
        """The mastering display, with the stated peak."""
        return metadata.mastering(self.peak_nits)


def default_chroma(codec: Codec) -> Chroma:
    """The default chroma of a grading codec, 4:2:0 for distribution codecs."""
    return MASTERS[codec][0] if codec in MASTERS else "420"


def pixel_format(chroma: Chroma, has_alpha: bool = False) -> str:
    """FFmpeg's name of planar Y'CbCr in 10 bits."""
    return f"yuv{'a' if has_alpha else ''}{chroma}p10le"


def check_speed(codec: Codec, speed: str | None) -> None:
    """Raise UsageError unless it is a preset of the codec's encoder."""
    known = SPEEDS.get(codec, ())
    if speed is not None and speed not in known:
        raise UsageError(
            f"--speed {speed}: no such preset for {codec}",
            remedy=f"Known: {', '.join(known)}." if known else "Omit --speed.",
        )


def check_film(path: Path, spec: FilmSpec) -> None:
    """Raise UsageError for a combination that players or encoders do not support."""
    if path.suffix.lower() not in MUXERS:
        raise UsageError(
            f"{path.name}: not the name of a film",
            remedy=f"Films end in {', '.join(MUXERS)} or .y4m (uncompressed), "
            "stills in .avif, .png, .tif or .jpg.",
        )
    if spec.codec == "av1" and path.suffix.lower() == ".mov":
        raise UsageError("AV1 is not possible in .mov", remedy="Name the output .mp4 or .mkv.")
    if spec.codec in MASTERS:
        _check_master(path, spec)
    elif spec.signal in ("acescct", "logc3"):
        raise UsageError(
            "log is for grading codecs only",
            remedy="Use --codec prores4444, prores or dnxhr, and .mov.",
        )
    if spec.pixel_aspect != 1 and spec.codec == "av1" and path.suffix.lower() == ".mkv":
        raise UsageError(  # AV1's header has none, and PyAV does not set Matroska's
            "AV1 in .mkv would lose the pixel aspect ratio", remedy="Name the output .mp4."
        )
    if spec.codec == "av1" and spec.chroma != "420":
        raise UsageError("SVT-AV1 encodes 4:2:0 only", remedy="Use --codec hevc or prores.")


def _check_master(path: Path, spec: FilmSpec) -> None:
    name = _NAMES[spec.codec]
    if path.suffix.lower() not in (".mov", ".mkv"):
        raise UsageError(f"{name} needs .mov or .mkv", remedy="Name the output film.mov.")
    if spec.crf is not None or spec.speed is not None:
        raise UsageError(f"{name} has a fixed quality", remedy="Omit --crf and --speed.")
    if spec.chroma not in MASTERS[spec.codec]:
        raise UsageError(f"{name} is not {':'.join(spec.chroma)}", remedy="Omit --chroma.")


def check_size(
    codec: Codec,
    width: int,
    height: int,
    name: str | None = None,
    remedy: str = "ProRes (--codec prores, .mov) supports any size.",
) -> None:
    """Raise UsageError for sizes that the codec does not support; `name` is what users call it."""
    least = _LEAST.get(codec, (2, 2))
    if width < least[0] or height < least[1]:
        name = name or _NAMES.get(codec, codec.upper())
        raise UsageError(
            f"{width}x{height} is too small for {name}: at least {least[0]}x{least[1]} is needed",
            remedy=remedy,
        )
