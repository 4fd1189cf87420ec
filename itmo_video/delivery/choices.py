"""What can be chosen of a preview, and what its encoders do by default."""

from __future__ import annotations

from typing import Literal

View = Literal[
    "hdr10", "hlg", "sdr", "compare", "false-colour", "ladder", "aces", "aces-hdr", "acescct",
    "logc3",
]  # fmt: skip
Layout = Literal["side", "wipe"]
Scale = Literal["stops", "nits"]
Codec = Literal["av1", "hevc", "prores", "prores4444", "dnxhr"]
Chroma = Literal["420", "422", "444"]
Depth = Literal["8", "10"]

DEFAULT_CRF: dict[str, int] = {"av1": 25, "hevc": 18}
AVIF_CRF = 12
DEFAULT_SPEED: dict[str, str] = {"av1": "5", "hevc": "fast"}
