"""What is measured, compared with what and on which display: the options of `evaluate`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from itmo_video.errors import UsageError
from itmo_video.options import check_options, option
from itmo_video.source.files import pixel_limit


@dataclass(frozen=True)
class EvaluateOptions:
    """What an EXR sequence is compared with; at least one of `source` and `reference` is needed.

    Validated when made; raises UsageError.

    >>> from pathlib import Path
    >>> from itmo_video import EvaluateOptions
    >>> EvaluateOptions(reference=Path("truth"), display_peak=600).display_peak
    600.0
    """

    source: Path | None = option(None, Path, "the SDR clip it was converted from", metavar="CLIP")
    motion: Path | None = option(
        None, Path, "known motion: a JSON file of where a panning window was in each frame "
        "(docs/flicker.md, Known motion)", metavar="FILE",
    )  # fmt: skip
    reference: Path | None = option(None, Path, "reference: a folder of EXR files", metavar="TRUTH")
    part: str | None = option(
        None, str, "the part of TRUTH's multi-part files, by name or number (default: the first "
        "with R, G and B)", metavar="PART",
    )  # fmt: skip
    key_interval: int | None = option(
        None,
        int,
        "keyframe interval for key_to_key (default: the folder's own, or 5)",
        lower=1,
        metavar="N",
    )
    white_nits: float | None = option(
        None,
        float,
        "luminance of 1.0 in nits (default: the folder's own, or 203)",
        lower=1,
        upper=10000,
        metavar="N",
    )
    display_peak: float = option(
        1000.0, float, "the display's peak in nits; both sides are clipped to it",
        lower=1, upper=1e6, metavar="N",
    )  # fmt: skip
    vdp: bool = option(False, bool, "add ColorVideoVDP's JOD (extra `vdp`; slow)")
    heat_map: Path | None = option(
        None, Path, "write a film of the differences that ColorVideoVDP sees (extra `vdp`; slow)",
        metavar="FILE.mp4",
    )  # fmt: skip
    overwrite: bool = option(False, bool, "overwrite the film of --heat-map if it exists")
    pixels_per_degree: float = option(
        45.0, float, "viewing resolution for ColorVideoVDP", lower=1, upper=1000, metavar="N"
    )
    ibl: bool = option(
        False, bool,
        "compare renders of a scene lit by the panoramas (latitude-longitude; extra `ibl`: "
        "Mitsuba); TEST and TRUTH may be one .exr or .hdr file, with 1.0 at SDR white",
    )  # fmt: skip
    max_pixels: int = pixel_limit()

    def __post_init__(self) -> None:
        check_options(self)
        if not self.source and not self.reference:
            raise UsageError("nothing to compare with", remedy="Give --source CLIP or --reference.")
        if (self.vdp or self.heat_map) and not self.reference:
            raise UsageError("ColorVideoVDP needs the truth", remedy="Give --reference TRUTH.")
        if self.ibl and (self.vdp or self.heat_map or self.motion or not self.reference):
            raise UsageError(
                "--ibl compares renders only",
                remedy="Give --reference TRUTH and --source CLIP, and omit the others.",
            )
