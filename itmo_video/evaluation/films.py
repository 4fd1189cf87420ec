"""Folders of EXR files, and clips, as films for a video metric."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise
from pathlib import Path

from itmo_video.evaluation.agreement import SDR, TEST, Display
from itmo_video.evaluation.folders import (
    Pair,
    frame_rate,
    frame_rgb,
    open_sequence,
    open_source,
    pair,
)
from itmo_video.evaluation.vdp import Film, Pictures, on_display
from itmo_video.events import OnEvent, Warned, ignore
from itmo_video.model import ASSUMED_SEQUENCE_RATE, Float32
from itmo_video.output.converted import RATE_ASSUMED
from itmo_video.source.files import MAX_PIXELS
from itmo_video.source.opening import Clip, frames_at


def films(
    test: Path,
    reference: Path,
    source: Path | None,
    display: Display,
    part: str | None = None,
    on_event: OnEvent = ignore,
    max_pixels: int = MAX_PIXELS,
) -> dict[str, Film]:
    """A folder with its truth by row: TEST, and SDR if the clip is given.

    Frames are matched as by `compare_sequences`. If frames are left out evenly, the rate is that
    of the remaining ones. `on_event` receives Warned if the rate is assumed. Raises InputError if
    folders or clip do not match.
    """
    sequence = open_sequence(test)
    pairs = pair(sequence, open_sequence(reference), part)
    clip = None if source is None else open_source(source, sequence, max_pixels)
    height, width = pairs[0].true_rgb().shape[:2]
    steps = [b.index - a.index for a, b in pairwise(pairs)]
    stated = frame_rate(sequence, clip)
    if stated is None:
        on_event(Warned(RATE_ASSUMED))
    rate = Fraction(stated or ASSUMED_SEQUENCE_RATE, min(steps, default=1))

    def converted() -> Pictures:
        for item in pairs:
            yield on_display(item.rgb(), display), _truth(item, display)

    made = {TEST: Film(converted, len(pairs), (width, height), rate)}
    if clip is not None:
        made[SDR] = Film(lambda: _original(clip, pairs, display), len(pairs), (width, height), rate)
    return made


def _original(clip: Clip, pairs: list[Pair], display: Display) -> Pictures:
    frames = frames_at(clip, [item.index for item in pairs])
    for item, frame in zip(pairs, frames, strict=True):
        yield on_display(frame_rgb(frame), display), _truth(item, display)


def _truth(item: Pair, display: Display) -> Float32:
    return on_display(item.true_rgb(), display)
