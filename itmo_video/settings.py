"""The settings: one definition each, for flag, TOML and the Python API."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar

from itmo_video import compressions
from itmo_video.errors import UsageError
from itmo_video.options import check_options, options_from
from itmo_video.options import option as setting
from itmo_video.untrusted import parse_rational

LAYERS = ("expand_map", "clip_mask", "gain")
_TIMECODE = re.compile(r"([01]\d|2[0-3]):[0-5]\d:[0-5]\d[:;][0-5]\d")
OUTPUT_PRIMARIES = ("rec709", "rec2020", "acescg", "aces2065-1")

OF_FILE = ("primaries", "compression", "layers", "owner", "comments", "timecode")
"""Settings of a frame's file."""

OF_CLIP = (
    "white_nits", "projection", "transfer", "matrix", "range", "deinterlace", "fps", "force_sdr",
    "stream", "raw", *OF_FILE,
)  # fmt: skip
"""Settings of a whole clip: how it is read, and how files are written; all others are the look,
which can be set per shot."""


@dataclass(frozen=True)
class Settings:
    """Everything that a frame's pixels and file depend on, except the source; always validated.

    `Settings()` has the bare defaults; a conversion uses `make_settings()` by default.

    >>> from itmo_video import Settings
    >>> Settings(key_interval=0)
    Traceback (most recent call last):
    itmo_video.errors.UsageError: key-interval must be from 1 to 60, not 0
    """

    asked: ClassVar[tuple[Mapping[str, Any], Mapping[str, Any]] | None] = None
    """The preset's values and the overrides, if created by make_settings; not part of its value."""

    operator: str = setting(
        "banterle2006",
        str,
        "inverse tone mapping operator; see `itmo-video operators`",
        metavar="NAME",
    )
    l_max: float | None = setting(
        None, float, "maximum luminance, SDR white = 1 (default: peak-nits / white-nits)",
        lower=1, upper=60000, metavar="X",
    )  # fmt: skip
    peak_nits: float = setting(
        1000.0, float, "peak luminance of the output in nits", lower=1, upper=1e6, metavar="N"
    )
    white_nits: float = setting(
        203.0, float, "luminance of SDR diffuse white in nits", lower=1, upper=10000, metavar="N"
    )
    l_white: float | None = setting(
        None, float, "L_white of eq. 7: higher keeps middle tones darker (default: l-max)",
        lower=0.01, upper=1e6, metavar="X",
    )  # fmt: skip
    alpha: float | None = setting(
        None, float, "key of eq. 4 instead of eq. 13; uses each frame's geometric mean",
        lower=1e-4, upper=100, metavar="X",
    )  # fmt: skip
    operator_params: dict[str, float] = setting(
        {}, dict, "parameter of the operator, such as threshold=0.7 (repeatable)",
        metavar="NAME=VALUE", flag="operator-param",
    )  # fmt: skip
    expand_map: bool = setting(True, bool, "weight the expansion by the Expand Map")
    strength: float = setting(
        1.0, float,
        "amount of expansion: 0 none, 1 full; up to 2 expands more, same peak",
        lower=0, upper=2, metavar="X",
    )  # fmt: skip
    footage: str = setting(
        "auto", str,
        "operator auto: how the footage was rendered to SDR; auto estimates it per shot",
        choices=("auto", "clipped", "tone-mapped"),
    )  # fmt: skip
    hue: str = setting(
        "restore", str,
        "operator auto: restore the colour of clipped channels, or keep the hue as recorded",
        choices=("restore", "keep"),
    )  # fmt: skip
    lamps: float = setting(
        1.0, float, "operator auto: brightness of small lights recorded below white in tone-mapped "
        "footage; above 1 not only at night, 0 leaves them",
        lower=0, upper=4, metavar="X",
    )  # fmt: skip
    over_white: str = setting(
        "clip", str, "code values above white: clip them, or keep them with the gain of white",
        choices=("clip", "keep"),
    )  # fmt: skip
    lights: int = setting(
        1024, int, "number of median-cut lights, a power of two", lower=2, upper=65536, metavar="N"
    )
    radius: float = setting(
        16.0, float, "radius of the density estimate at 512x768, in pixels; scales with the frame",
        lower=1, upper=512, metavar="PX",
    )  # fmt: skip
    min_lights: int = setting(
        4, int, "no expansion with fewer lights than this within the radius",
        lower=0, upper=1024, metavar="N",
    )  # fmt: skip
    soft_lights: bool = setting(
        False, bool, "soft light threshold; flickers less than the paper's hard one"
    )
    map_width: int = setting(
        512,
        int,
        "maximum width at which the Expand Map is computed",
        lower=16,
        upper=4096,
        metavar="PX",
    )
    key_interval: int = setting(
        5, int, "frames between keyframes of the Expand Map", lower=1, upper=60, metavar="N"
    )
    temporal: str = setting(
        "tracked", str, "map between keyframes: tracked by optical flow, blended, or one per frame",
        choices=("tracked", "blend", "per-frame"),
    )  # fmt: skip
    smooth_keys: int = setting(
        0, int, "average each keyframe's map with this many keyframes on either side",
        lower=0, upper=8, metavar="N",
    )  # fmt: skip
    edge_aware: bool = setting(True, bool, "upsample the map along edges in the picture")
    noise_guard: bool = setting(False, bool, "keep the expansion from amplifying grain and banding")
    projection: str = setting(
        "flat",
        str,
        "flat picture, or latitude-longitude (equirectangular) panorama",
        choices=("flat", "latlong"),
    )
    transfer: str = setting(
        "auto", str, "the source's transfer function",
        choices=("auto", "bt1886", "srgb", "gamma22", "linear"),
    )  # fmt: skip
    matrix: str = setting(
        "auto", str, "the source's YCbCr matrix", choices=("auto", "bt709", "bt601", "bt2020")
    )
    range: str = setting(
        "auto", str, "the source's code range", choices=("auto", "limited", "full")
    )
    deinterlace: str = setting(
        "auto", str, "deinterlace frames flagged as interlaced", choices=("auto", "off", "force")
    )
    fps: str | None = setting(
        None, str, "resample to a constant frame rate: 25, 23.976, 24000/1001", metavar="N"
    )
    stream: int | None = setting(
        None, int, "video stream to read (default: the one flagged as default; see `info`)",
        lower=0, upper=10000, metavar="N",
    )  # fmt: skip
    raw: str | None = setting(
        None, str, "format of raw frames from a pipe, such as yuv420p10le:1920x1080:24000/1001",
        metavar="FORMAT:WxH:FPS",
    )  # fmt: skip
    force_sdr: bool = setting(False, bool, "treat a source tagged as HDR as SDR")
    primaries: str = setting("rec709", str, "primaries of the output", choices=OUTPUT_PRIMARIES)
    compression: str = setting("zip", str, "EXR compression", choices=compressions.WRITTEN)
    layers: tuple[str, ...] = setting(
        (), tuple, f"extra EXR layers, comma-separated: {', '.join(LAYERS)}",
        metavar="NAME,...",
    )  # fmt: skip
    owner: str | None = setting(None, str, "owner, written to each EXR header", metavar="TEXT")
    comments: str | None = setting(
        None, str, "comments, written to each EXR header", metavar="TEXT"
    )
    timecode: str | None = setting(
        None, str, "timecode of the clip's first frame, HH:MM:SS:FF (;FF for drop frame), or auto: "
        "the source's, or else counted from frame numbers (default: the source's)",
        metavar="TC",
    )  # fmt: skip

    def __post_init__(self) -> None:
        check_options(self)
        _ = self.frame_rate  # raises if it is invalid
        if self.timecode not in (None, "auto") and not _TIMECODE.fullmatch(str(self.timecode)):
            raise UsageError(
                f"timecode must be HH:MM:SS:FF or auto, not {self.timecode!r}",
                remedy="Drop-frame timecode has a semicolon before the frames: 01:00:00;00.",
            )
        if self.lights & (self.lights - 1):
            raise UsageError(f"lights must be a power of two, not {self.lights}")
        if unknown := [name for name in self.layers if name not in LAYERS]:
            raise UsageError(
                f"layers: unknown {', '.join(map(str, unknown))}",
                remedy=f"Known: {', '.join(LAYERS)}",
            )
        if self.l_max is None and self.peak_nits < self.white_nits:
            raise UsageError(
                f"peak-nits {self.peak_nits:g} is below white-nits {self.white_nits:g}",
                remedy="The peak must be at least SDR white.",
            )

    @property
    def frame_rate(self) -> Fraction | None:
        """The frame rate that the source is resampled to; None to keep its own."""
        if self.fps is None:
            return None
        try:
            rate = parse_rational(self.fps)
        except ValueError:
            rate = Fraction(0)
        if not 0 < rate <= 1000:
            raise UsageError(f"fps must be a rate such as 25 or 24000/1001, not {self.fps!r}")
        # 23.976 and 29.97 are common spellings of the NTSC rates.
        ntsc = Fraction(round(rate) * 1000, 1001)
        return ntsc if abs(rate - ntsc) < Fraction(1, 200) else rate

    @property
    def l_max_effective(self) -> float:
        """L'max in units of SDR white, from l_max or from the nits."""
        return self.l_max if self.l_max is not None else self.peak_nits / self.white_nits

    @property
    def l_white_effective(self) -> float:
        """L_white of eq. 7; equal to L'max unless set (the paper: of the same order)."""
        return self.l_white if self.l_white is not None else self.l_max_effective

    @property
    def key_reach(self) -> int:
        """The effective keyframe interval: 1 if every frame has its own map."""
        return 1 if self.temporal == "per-frame" else self.key_interval

    @property
    def smooth_reach(self) -> int:
        """The number of keyframes on either side that a keyframe's map is averaged with."""
        return self.smooth_keys if self.temporal == "tracked" else 0

    def as_dict(self) -> dict[str, Any]:
        """Plain values by name, ready for JSON, with derived values resolved."""
        plain = dataclasses.asdict(self)
        plain["l_max"], plain["l_white"] = self.l_max_effective, self.l_white_effective
        plain["layers"] = list(self.layers)
        return plain


LOOK = tuple(f.name for f in dataclasses.fields(Settings) if f.name not in OF_CLIP)
"""The settings of the look, which can be set per shot."""


def settings_from(values: Mapping[str, Any]) -> Settings:
    """Settings from plain values; raises UsageError for unknown names."""
    return options_from(Settings, values, "setting")
