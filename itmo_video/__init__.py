"""Turns SDR video into HDR: the Expand Map of Banterle et al. 2006, tracked along motion."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from itmo_video.analysis.analyse import analyse
    from itmo_video.analysis.model import Analysis
    from itmo_video.analysis.reading import read_analysis
    from itmo_video.conversion.convert import Summary, convert
    from itmo_video.conversion.plan import Plan
    from itmo_video.conversion.run_options import RunOptions
    from itmo_video.errors import (
        AlreadyHdrError,
        CheckFailedError,
        DamagedInputError,
        InputError,
        ItmoError,
        OutputError,
        UsageError,
    )
    from itmo_video.model import ClipInfo, Encoding, Frame
    from itmo_video.output.exr import read_exr
    from itmo_video.presets import make_settings
    from itmo_video.settings import Settings
    from itmo_video.source.opening import Clip, open_clip

_ROOMS = {
    "analysis.analyse": ("analyse",),
    "analysis.model": ("Analysis",),
    "analysis.reading": ("read_analysis",),
    "conversion.convert": ("Summary", "convert"),
    "errors": (
        "AlreadyHdrError",
        "CheckFailedError",
        "DamagedInputError",
        "InputError",
        "ItmoError",
        "OutputError",
        "UsageError",
    ),
    "output.exr": ("read_exr",),
    "model": ("ClipInfo", "Encoding", "Frame"),
    "conversion.plan": ("Plan",),
    "conversion.run_options": ("RunOptions",),
    "source.opening": ("Clip", "open_clip"),
    "presets": ("make_settings",),
    "settings": ("Settings",),
}
_HOMES = {name: room for room, names in _ROOMS.items() for name in names}

__all__ = [
    "AlreadyHdrError",
    "Analysis",
    "CheckFailedError",
    "Clip",
    "ClipInfo",
    "DamagedInputError",
    "Encoding",
    "Frame",
    "InputError",
    "ItmoError",
    "OutputError",
    "Plan",
    "RunOptions",
    "Settings",
    "Summary",
    "UsageError",
    "analyse",
    "convert",
    "make_settings",
    "open_clip",
    "read_analysis",
    "read_exr",
]


def __getattr__(name: str) -> Any:
    # Rooms are imported when first used, so that `itmo-video --help` answers at once.
    if name in _HOMES:
        return getattr(import_module(f"itmo_video.{_HOMES[name]}"), name)
    raise AttributeError(f"module 'itmo_video' has no attribute {name!r}")
