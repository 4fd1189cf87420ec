"""HDR without a transfer tag: Dolby Vision, HDR10 metadata, and camera log."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from itmo_video.regular_file import open_regular
from itmo_video.source.track_facts import TrackFacts

_DOLBY_ENTRIES = ("dvh1", "dvhe", "dav1", "dva1", "dvav")
_HDR10_SIDES = {
    "MASTERING_DISPLAY_METADATA": "mastering display",
    "CONTENT_LIGHT_LEVEL": "MaxCLL and MaxFALL",
    "DYNAMIC_HDR_PLUS": "HDR10+",
}
_UNTAGGED = (0, 2)
MAP_TO_SDR = (
    "Tone-map it to SDR first (libplacebo: ffmpeg -vf libplacebo=colorspace=bt709...); if it is "
    "SDR after all, use --transfer bt1886 or --force-sdr."
)
UNDO_LOG = (
    "Convert it to display-referred SDR first, with the camera's LUT or transform; if it is SDR "
    "after all, use --force-sdr."
)
_LOG_NAMES = re.compile(
    r"\b(s-?log-?[23]?|slog[23]?|c-?log-?[23]?|canon log ?[23]?|v-?log(?:-?l)?|d-?log(?:-?m)?|"
    r"n-?log|f-?log2?|log-?c[34]?|apple[ .-]?log2?|log3g10|redlogfilm|blackmagic.*film|"
    r"protune.*flat|l-?log|z-?log2?|i-?log)\b",
    re.IGNORECASE,
)
_ABOUT_CURVES = re.compile(
    r"gamma|log|transfer|colou?r|capture|look|profile|picture", re.IGNORECASE
)
_XML = re.compile(
    rb'(?:CaptureGammaEquation|GammaEquation|CaptureTransferFunction)"?\s*(?:value="|>)([^"<]{1,40})',
    re.IGNORECASE,
)
_ENDS = 1 << 20  # cameras write their XML near the start or the end of the file


def dolby_vision_words(track: TrackFacts, frame: Any, transfer: int) -> str | None:
    """Why a stream is non-SDR Dolby Vision, None if it is not or has a transfer tag."""
    record = track.dolby_vision
    if record is not None:
        if record.compatibility == 2 or (record.compatibility in (1, 4) and transfer in (16, 18)):
            return None
        base = {1: "HDR10", 4: "HLG"}.get(
            record.compatibility, "IPT-PQ, which no player shows as is"
        )
        return f"Dolby Vision profile {record.profile}: its base layer is {base}"
    if transfer not in _UNTAGGED:
        return None
    if track.sample_entry in _DOLBY_ENTRIES:
        return f"Dolby Vision (sample entry {track.sample_entry})"
    if any(kind.startswith("DOVI") for kind in _side_data(frame)):
        return "frames have Dolby Vision metadata but no transfer tag"
    return None


def hdr10_words(frame: Any, transfer: int) -> str | None:
    """Why a stream is HDR10 whose transfer tag was lost, None if it is tagged or shows no sign."""
    if transfer not in _UNTAGGED:
        return None
    found = [_HDR10_SIDES[name] for name in _side_data(frame) if name in _HDR10_SIDES]
    if not found:
        return None
    return f"frames have HDR10 metadata ({', '.join(found)}) but no transfer tag"


def log_words(path: Path | None, metadata: Iterable[Mapping[str, str]]) -> str | None:
    """The camera log named by a clip's metadata, in words; None if there is none.

    `path` is None for a stream that is not a file.
    """
    for tags in metadata:
        for name, value in tags.items():
            found = _LOG_NAMES.search(value) if _ABOUT_CURVES.search(name) else None
            if found:
                return f"log footage by its metadata: {found[0]} ({name})"
    for block in _both_ends(path) if path else ():
        for match in _XML.finditer(block):
            value = match[1].decode("latin-1")
            if _LOG_NAMES.search(value):
                return f"log footage by the camera's metadata: gamma {value}"
    return None


def _side_data(frame: Any) -> list[str]:
    try:
        sides = frame.side_data
        # By index, because iteration yields keys from PyAV 19 on.
        return [str(sides[index].type.name) for index in range(len(sides))]
    except ValueError:  # PyAV 18 does not know every kind of side data
        return []


def _both_ends(path: Path) -> Iterable[bytes]:
    with suppress(OSError), open_regular(path) as file:  # a disk may fail at the far end
        yield file.read(_ENDS)
        size = path.stat().st_size
        if size > _ENDS:
            file.seek(max(_ENDS, size - _ENDS))
            yield file.read(_ENDS)
