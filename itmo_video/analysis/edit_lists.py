"""Reading and writing edit lists: OpenTimelineIO (.otio) and CMX3600 (.edl); extra `otio`.

The start of an edit's timeline is the clip's first frame. Indices count the clip's frames from 0,
ranges are inclusive.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

from itmo_video.analysis.edl_timecodes import finished, without_drop_frame
from itmo_video.analysis.model import Analysis
from itmo_video.errors import InputError, UsageError
from itmo_video.model import ClipInfo
from itmo_video.source import timecode
from itmo_video.untrusted import read_json, read_text
from itmo_video.words import to_install

SUFFIXES = (".otio", ".edl")
_NEAR = Fraction(1, 100)  # of a frame; times at other rates may fall between frames

Range = tuple[int, int]


def is_edit_list(path: str | Path) -> bool:
    """Whether a file name is that of an edit list."""
    return Path(path).suffix.lower() in SUFFIXES


def read_edit(path: str | Path, info: ClipInfo) -> list[Range]:
    """The shots of an edit list as first and last index, in order, without gaps between clips.

    Upper video tracks cover lower ones, as in an editor. Raises InputError if the file cannot be
    read, UsageError if its times do not match frames of the clip.
    """
    if not is_edit_list(path):
        raise UsageError(f"edit lists must be {', '.join(SUFFIXES)}", where=str(path))
    otio, text = _otio(), read_text(path)
    is_edl = Path(path).suffix.lower() == ".edl"
    if not is_edl:
        read_json(path)  # limits the depth, which the library does not
    base = _nominal(info.frame_rate)
    if is_edl:
        text = without_drop_frame(text, base)
    options = {"rate": float(base)} if is_edl else {}
    try:
        read = otio.adapters.read_from_string(
            text, adapter_name="cmx_3600" if is_edl else "otio_json", **options
        )
        if not isinstance(read, otio.schema.Timeline):
            raise ValueError("it has no timeline")
        track = otio.algorithms.flatten_stack(_shown_tracks(otio, read))
        ranges = [
            _frames(track.range_of_child(item), info.frame_rate, path)
            for item in track
            if isinstance(item, otio.schema.Clip | otio.core.Composition)
        ]
    except UsageError:
        raise
    except Exception as error:  # the adapters raise anything
        raise InputError(f"not a valid edit list: {error}", where=str(path)) from error
    _check(ranges, info, path)
    return ranges


def edit_of(analysis: Analysis, info: ClipInfo, suffix: str) -> str:
    """An analysis as an edit list: one clip per shot, keyframes as markers, from 01:00:00:00 on.

    Source times start at the clip's timecode, or at 0; an EDL of a drop-frame clip is drop-frame.
    Raises UsageError for a timecode that the clip's frame rate does not have.
    """
    otio = _otio()
    base, code = _nominal(info.frame_rate), info.timecode or "00:00:00:00"
    rate = float(base if suffix == ".edl" else info.frame_rate)
    is_drop = timecode.is_drop_frame(code) and base % 30 == 0

    def span(first: int, frames: int) -> Any:
        time = otio.opentime.RationalTime
        return otio.opentime.TimeRange(time(first, rate), time(frames, rate))

    begin = _frames_before(code, base, is_drop, info.path)
    timeline = otio.schema.Timeline(Path(info.path).stem)
    hour = timecode.count_of("01:00:00:00", base, is_drop)
    timeline.global_start_time = otio.opentime.RationalTime(hour, rate)
    track = otio.schema.Track("shots", kind=otio.schema.TrackKind.Video)
    timeline.tracks.append(track)
    at = 0
    for number, shot in enumerate(analysis.shots, 1):
        first, last = (n - analysis.first_number for n in (shot.first, shot.last))
        if first > at:
            track.append(otio.schema.Gap(source_range=span(0, first - at)))
        media = otio.schema.ExternalReference(
            Path(info.path).name, available_range=span(begin, info.frames)
        )
        media.name = Path(info.path).stem
        clip = otio.schema.Clip(
            f"{Path(info.path).stem} {number:03d}", media, span(begin + first, last - first + 1)
        )
        clip.markers.extend(
            otio.schema.Marker(
                "keyframe", span(begin + key - analysis.first_number, 0), color="GREEN"
            )
            for key in analysis.keyframes
            if suffix == ".otio" and shot.first <= key <= shot.last
        )
        track.append(clip)
        at = last + 1
    if suffix == ".edl":
        text = str(otio.adapters.write_to_string(timeline, "cmx_3600", rate=rate))
        return finished(text, base, is_drop)
    return str(otio.adapters.write_to_string(timeline, "otio_json")) + "\n"


def _otio() -> Any:
    try:
        import opentimelineio
    except ImportError as error:
        raise UsageError("edit lists need opentimelineio", remedy=to_install("otio")) from error
    return opentimelineio


def _shown_tracks(otio: Any, timeline: Any) -> list[Any]:
    """The video tracks that are enabled, with gaps for the clips in them that are not."""
    tracks = [track for track in timeline.video_tracks() if track.enabled]
    for track in tracks:
        for at, item in enumerate(track):
            if isinstance(item, otio.core.Item) and not item.enabled:
                track[at] = otio.schema.Gap(source_range=item.trimmed_range())
    return tracks


def _nominal(rate: Fraction) -> int:
    """The frame numbers of a second of timecode: 24 for 23.976."""
    return max(1, round(rate))


def _frames_before(code: str, base: int, is_drop: bool, where: str) -> int:
    count = timecode.count_of(code, base, is_drop)
    if count is None or int(code[-2:]) >= base:
        raise UsageError(
            f"timecode {code} is not possible in an edit list at {base} fps",
            where=where,
            remedy="Write the shots as .json, or correct the clip's timecode.",
        )
    return count


def _frames(span: Any, rate: Fraction, path: str | Path) -> Range:
    """The first and last index of a time range on the timeline."""
    ends = []
    for time in (span.start_time, span.end_time_exclusive()):
        own = Fraction(time.rate).limit_denominator(1001)
        # Timecode at 24 counts frames of 23.976, too.
        is_same = abs(own / rate - 1) < Fraction(2, 1000)
        index = Fraction(time.value) * (1 if is_same else rate / own)
        if abs(index - round(index)) > _NEAR:
            raise UsageError(
                f"a cut at {float(index):.2f} frames falls between frames of the clip",
                where=str(path), remedy=f"Export the edit at the clip's rate, {float(rate):.3f}.",
            )  # fmt: skip
        ends.append(round(index))
    return ends[0], ends[1] - 1


def _check(ranges: Sequence[Range], info: ClipInfo, path: str | Path) -> None:
    if not ranges:
        raise UsageError("the edit list has no shots", where=str(path))
    last = max(end for _, end in ranges)
    if last >= info.frames:
        raise UsageError(
            f"the edit has {last + 1} frames, but the clip has {info.frames}", where=str(path),
            remedy="Give the clip that was exported from this edit.",
        )  # fmt: skip
    if any(end < begin for begin, end in ranges):
        raise UsageError("the edit list has a shot without frames", where=str(path))
