"""Facts about video tracks in Matroska that FFmpeg does not expose (RFC 9559)."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from itmo_video.model import ChromaSiting
from itmo_video.regular_file import open_regular
from itmo_video.source.track_facts import TrackFacts, dolby_vision

_SEGMENT, _TRACKS, _CLUSTER, _ENTRY = 0x18538067, 0x1654AE6B, 0x1F43B675, 0xAE
_TYPE, _VIDEO, _CODEC = 0x83, 0xE0, 0x86
_CROPS = (0x54CC, 0x54BB, 0x54DD, 0x54AA)  # PixelCropLeft, Top, Right, Bottom
_MAPPING, _MAPPING_TYPE, _MAPPING_DATA = 0x41E4, 0x41E7, 0x41ED
_DOLBY_TYPES = {int.from_bytes(name, "big") for name in (b"dvcC", b"dvvC", b"dvwC")}
_COLOUR, _SITING = 0x55B0, (0x55B7, 0x55B8)  # ChromaSitingHorz and Vert: 1 cosited, 2 between
_SITINGS: dict[tuple[int, int], ChromaSiting] = {
    (1, 1): "topleft", (1, 2): "left", (2, 1): "top", (2, 2): "center",
}  # fmt: skip
_HEAD_BYTES, _MOST_TRACKS_BYTES = 4096, 8 << 20


def video_tracks(path: Path) -> list[TrackFacts]:
    """Facts about the video tracks in order; empty if the elements are damaged."""
    try:
        with open_regular(path) as file:
            return [_facts(track) for track in _video_entries(file)]
    except (OSError, ValueError, IndexError):
        return []


def siting_in(data: bytes) -> ChromaSiting | None:
    """The chroma siting that a file's first video track states; None if it states none."""
    for track in _video_entries(io.BytesIO(data)):
        colour = dict_of(dict_of(track.get(_VIDEO, [b""])[0]).get(_COLOUR, [b""])[0])
        across, down = (_number(colour.get(kind, [b""])[0]) for kind in _SITING)
        return _SITINGS.get((across, down))
    return None


def _video_entries(file: BinaryIO) -> list[dict[int, list[bytes]]]:
    tracks = [dict_of(entry) for kind, entry in _elements(_tracks(file)) if kind == _ENTRY]
    return [track for track in tracks if _number(track.get(_TYPE, [b""])[0]) == 1]


def _tracks(file: BinaryIO) -> bytes:
    """The body of the Tracks element, which precedes the first Cluster."""
    at = 0
    for _ in range(1000):
        file.seek(at)
        head = file.read(12)
        kind, size, start = _element_head(head, 0)
        if kind == _TRACKS:
            file.seek(at + start)
            return file.read(min(size, _MOST_TRACKS_BYTES))
        if kind == _CLUSTER:
            break
        at += start if kind == _SEGMENT else start + size
    return b""


def _element_head(data: bytes, at: int) -> tuple[int, int, int]:
    """(id, body size, header size in bytes) of an element (RFC 8794, 4 to 6)."""
    first = data[at]
    id_length = 9 - first.bit_length()
    kind = int.from_bytes(data[at : at + id_length], "big")
    first = data[at + id_length]
    length = 9 - first.bit_length()
    if id_length > 4 or length > 8:
        raise ValueError("no element")
    size = int.from_bytes(data[at + id_length : at + id_length + length], "big")
    return kind, size & ((1 << 7 * length) - 1), id_length + length


def _elements(data: bytes) -> Iterator[tuple[int, bytes]]:
    at = 0
    while at < len(data):
        kind, size, start = _element_head(data, at)
        yield kind, data[at + start : at + start + size]
        at += start + size


def dict_of(data: bytes) -> dict[int, list[bytes]]:
    """Bodies by element id."""
    found: dict[int, list[bytes]] = {}
    for kind, body in _elements(data):
        found.setdefault(kind, []).append(body)
    return found


def _number(body: bytes) -> int:
    return int.from_bytes(body, "big")


def _facts(track: dict[int, list[bytes]]) -> TrackFacts:
    video = dict_of(track.get(_VIDEO, [b""])[0])
    left, top, right, bottom = (_number(video.get(kind, [b""])[0]) for kind in _CROPS)
    record = None
    for body in track.get(_MAPPING, []):
        mapping = dict_of(body)
        if _number(mapping.get(_MAPPING_TYPE, [b""])[0]) in _DOLBY_TYPES:
            record = mapping.get(_MAPPING_DATA, [b""])[0]
    return TrackFacts(
        sample_entry=track.get(_CODEC, [b""])[0].decode("latin-1"),
        crop=(left, top, right, bottom) if left or top or right or bottom else None,
        dolby_vision=dolby_vision(record),
    )
