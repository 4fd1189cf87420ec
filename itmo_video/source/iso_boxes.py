"""Facts about video tracks in MP4 and MOV that FFmpeg does not expose (ISO/IEC 14496-12)."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

from itmo_video.regular_file import open_regular
from itmo_video.source.track_facts import TrackFacts, dolby_vision

_MOST_BYTES = 64 << 20  # of the moov box, which is read at once
_MOST_BOXES = 100_000


def video_tracks(path: Path) -> dict[int, TrackFacts]:
    """Facts about the video tracks by track number; empty if the boxes are damaged."""
    try:
        moov = _moov(path)
        tracks = [_track(box) for name, box in _boxes(moov) if name == b"trak"]
        return dict(track for track in tracks if track is not None)
    except (struct.error, OSError, ValueError, IndexError):
        return {}


def lacks_index(path: Path) -> bool:
    """Whether a file begins as an MP4 or MOV, but its index (the moov box) never follows."""
    try:
        with open_regular(path) as file:
            begins = file.read(8)[4:] in (b"ftyp", b"mdat", b"wide", b"free")
        return begins and not _moov(path)
    except (struct.error, OSError):
        return False


def _moov(path: Path) -> bytes:
    at, size = 0, path.stat().st_size
    with open_regular(path) as file:
        for _ in range(_MOST_BOXES):
            file.seek(at)
            head = file.read(16)
            if len(head) < 8:
                break
            length, name = struct.unpack_from(">I4s", head)
            start = 8
            if length == 1 and len(head) == 16:
                length, start = struct.unpack_from(">Q", head, 8)[0], 16
            if length == 0:
                length = size - at
            if length < start:
                break
            if name == b"moov":
                file.seek(at + start)
                return file.read(min(length - start, _MOST_BYTES))
            at += length
    return b""


def _boxes(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    at = 0
    while at + 8 <= len(data):
        length, name = struct.unpack_from(">I4s", data, at)
        start = 8
        if length == 1:
            length, start = struct.unpack_from(">Q", data, at + 8)[0], 16
        if length == 0:
            length = len(data) - at
        if length < start:
            return
        yield name, data[at + start : at + length]
        at += length


def _inside(data: bytes, *names: bytes) -> bytes | None:
    found: bytes | None = data
    for name in names:
        found = next((body for kind, body in _boxes(found or b"") if kind == name), None)
    return found


def _track(trak: bytes) -> tuple[int, TrackFacts] | None:
    head, entries = _inside(trak, b"tkhd"), _inside(trak, b"mdia", b"minf", b"stbl", b"stsd")
    if head is None or entries is None or _inside(trak, b"mdia", b"minf", b"vmhd") is None:
        return None
    number = struct.unpack_from(">I", head, 20 if head[0] == 1 else 12)[0]
    name, entry = next(_boxes(entries[8:]), (b"", b""))
    width, height = struct.unpack_from(">HH", entry, 24)
    children = dict(_boxes(entry[78:]))
    record = next((children[n] for n in (b"dvcC", b"dvvC", b"dvwC") if n in children), None)
    return number, TrackFacts(
        sample_entry=name.decode("latin-1"),
        crop=_clean_aperture(children.get(b"clap"), width, height),
        dolby_vision=dolby_vision(record),
    )


def _clean_aperture(
    clap: bytes | None, width: int, height: int
) -> tuple[int, int, int, int] | None:
    """(left, top, right, bottom) pixels to crop (12.1.4); None if nothing is cropped."""
    if clap is None or len(clap) < 32:
        return None
    n = struct.unpack(">IIIIiIiI", clap[:32])
    if 0 in n[1::2]:
        return None
    wide, high, right_by, down_by = (n[i] / n[i + 1] for i in (0, 2, 4, 6))
    left = round((width - wide) / 2 + right_by)
    top = round((height - high) / 2 + down_by)
    crop = (left, top, width - round(wide) - left, height - round(high) - top)
    return crop if min(crop) >= 0 and any(crop) else None
