"""Facts about a video stream from its container's boxes, for any supported container."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from itmo_video.source import iso_boxes, matroska
from itmo_video.source.streams import codec_tag
from itmo_video.source.track_facts import TrackFacts


def track_of(path: Path, container: Any, stream: Any) -> TrackFacts:
    """The facts about an open container's stream; empty if its boxes contain none."""
    name = str(container.format.name)
    if name.startswith("mov"):
        return iso_boxes.video_tracks(path).get(int(stream.id), TrackFacts())
    if name.startswith("matroska"):
        videos = [s.index for s in container.streams if s.type == "video"]
        tracks, at = matroska.video_tracks(path), videos.index(stream.index)
        return tracks[at] if at < len(tracks) else TrackFacts()
    return TrackFacts(sample_entry=codec_tag(stream.codec_context))
