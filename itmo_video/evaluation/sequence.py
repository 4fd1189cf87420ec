"""The flicker of a converted folder, shot by shot, along the clip's motion."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np

from itmo_video.colour.analysis_picture import analysis_size
from itmo_video.colour.primaries import LUMINANCE_WEIGHTS_BT709
from itmo_video.errors import InputError, UsageError
from itmo_video.evaluation import flicker
from itmo_video.evaluation.folders import (
    ExrSequence,
    exr_rgb,
    frame_rgb,
    open_sequence,
    open_source,
)
from itmo_video.events import FrameDone, OnEvent, ignore
from itmo_video.model import Code, Float32
from itmo_video.motion.cut_detection import CUT_REACH, Analysed, analyse_frame, place
from itmo_video.source.files import MAX_PIXELS
from itmo_video.source.opening import Clip
from itmo_video.untrusted import read_json

Origins = Sequence[tuple[float, float]]
METRICS = (
    "map_flicker", "gain_flicker", "background_drift", "noise_gain", "key_to_key",
)  # fmt: skip


@dataclass
class ShotFlicker:
    """A shot's first and last frame, by file number, and its figures; NaN if unknown."""

    first: int
    last: int
    figures: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class _Seen:
    """One frame at analysis size; `reduction` is the clip's size over it, (x, y)."""

    index: int
    reduction: tuple[float, float]
    grey: Code
    gain_stops: Float32
    weight: Float32 | None
    background: float
    noise_gain: float
    starts_shot: bool


def flicker_by_shot(
    folder: Path,
    source: Path,
    origins: Origins | None,
    key_interval: int | None = None,
    on_event: OnEvent = ignore,
    max_pixels: int = MAX_PIXELS,
) -> list[ShotFlicker]:
    """Flicker figures of each shot of a converted folder; by known origins or estimated flow.

    Compares the luminances of SDR and HDR, so the folder may come from any program; map flicker
    needs the layer expand_map. Only steps to the very next frame count. Keyframes are
    `key_interval` frames apart, by default as in the folder's settings. Raises InputError if folder
    and clip do not match.
    """
    sequence = open_sequence(folder)
    interval = key_interval or sequence.settings_or_default.key_interval
    shots: list[ShotFlicker] = []
    running: _Running | None = None
    for done, frame in enumerate(_frames(sequence, source, max_pixels), 1):
        if running is None or frame.starts_shot:
            if running is not None:
                shots.append(running.shot())
            running = _Running(frame.index, origins, interval)
        running.add(frame)
        on_event(FrameDone(sequence.first_number + frame.index, done, len(sequence.files)))
    if running is not None:
        shots.append(running.shot())
    start = sequence.first_number
    return [ShotFlicker(shot.first + start, shot.last + start, shot.figures) for shot in shots]


def over_shots(shots: Sequence[ShotFlicker]) -> dict[str, float]:
    """The clip's figures: means over shots, weighted by length; of drift, the maximum."""
    out: dict[str, float] = {}
    for name in METRICS:
        pairs = [(s.figures[name], s.last - s.first + 1) for s in shots]
        pairs = [(value, length) for value, length in pairs if not math.isnan(value)]
        if not pairs:
            out[name] = math.nan
        elif name == "background_drift":
            out[name] = max(value for value, _ in pairs)
        else:
            total = sum(length for _, length in pairs)
            out[name] = sum(value * length for value, length in pairs) / total
    return out


def read_origins(path: Path) -> Origins:
    """Window origins (x, y) by frame index, in the clip's pixels; raises UsageError otherwise.

    The file is JSON with "origins", a pair of numbers for each frame of the clip; other entries are
    ignored.
    """
    try:
        origins = read_json(path)["origins"]
        return [(float(x), float(y)) for x, y in origins]
    except (InputError, ValueError, KeyError, TypeError, OverflowError) as error:
        raise UsageError(f"the origins cannot be read: {error}", where=str(path)) from error


def luminance(rgb: Float32) -> Float32:
    """Luminance of linear BT.709 RGB (H, W, 3), by the weights of measurements."""
    return np.asarray(rgb @ np.array(LUMINANCE_WEIGHTS_BT709, np.float32), np.float32)


def _frames(sequence: ExrSequence, source: Path, max_pixels: int) -> Iterator[_Seen]:
    settings = sequence.settings_or_default
    files = sequence.by_index
    last = max(files)
    unseen = set(files)
    starts_shot = False
    with open_source(source, sequence, max_pixels) as clip:
        width, height = analysis_size(*clip.info.display_size, settings.map_width)
        # Frames before the first file count for cuts, too, as it may closely follow one.
        start = max(0, min(files) - 2 * CUT_REACH)
        for placed in place(_analysed(clip, start, settings.map_width), 1, start):
            frame = placed.analysed
            if frame.index > last:
                break
            starts_shot = starts_shot or placed.starts_shot
            if frame.index not in files:
                continue
            unseen.discard(frame.index)
            path = files[frame.index]
            image = sequence.read(frame.index + sequence.first_number)
            before = frame_rgb(frame.frame)
            sdr, hdr = luminance(before), luminance(exr_rgb(image, path))
            if hdr.shape != sdr.shape:
                raise InputError(f"not of the clip's size, {sdr.shape[::-1]}", where=str(path))
            gain = flicker.log_gain(hdr, sdr)
            weight = image.channels.get("expand_map.Y")
            yield _Seen(
                frame.index,
                (width / sdr.shape[1], height / sdr.shape[0]),
                frame.grey,
                _small(gain, width, height),
                None if weight is None else _small(weight.astype(np.float32), width, height),
                flicker.background_level(gain, sdr),
                flicker.noise_gain(hdr, sdr, before.max(axis=2)),
                starts_shot,
            )
            starts_shot = False
    if unseen:
        raise InputError(
            f"has no frame for {files[min(unseen)].name}",
            where=str(source),
            remedy="Give the clip that the folder was made from.",
        )


def _analysed(clip: Clip, start: int, map_width: int) -> Iterator[Analysed]:
    for frame in clip.frames(start):
        yield analyse_frame(frame, map_width)


def _small(values: Float32, width: int, height: int) -> Float32:
    if values.shape == (height, width):
        return values
    return np.asarray(cv2.resize(values, (width, height), interpolation=cv2.INTER_AREA))


class _Mean:
    """A running mean of what is not NaN; NaN if empty."""

    def __init__(self) -> None:
        self._total, self._count = 0.0, 0

    def add(self, value: float) -> None:
        if not math.isnan(value):
            self._total += value
            self._count += 1

    @property
    def value(self) -> float:
        return self._total / self._count if self._count else math.nan


class _Running:
    """Accumulates a shot's figures; holds the pictures of the last frame and keyframe only."""

    def __init__(self, first: int, origins: Origins | None, key_interval: int) -> None:
        self._first = self.last = first
        self._origins, self._key_interval = origins, key_interval
        self._before: _Seen | None = None
        self._key: _Seen | None = None
        self._lowest, self._highest = math.inf, -math.inf
        self._means = {name: _Mean() for name in METRICS if name != "background_drift"}

    def add(self, frame: _Seen) -> None:
        if self._before is not None and self._before.index + 1 == frame.index:
            gain, weight = self._change(self._before, frame)
            self._means["gain_flicker"].add(gain)
            self._means["map_flicker"].add(weight)
        if frame.index % self._key_interval == 0:
            if self._key is not None and self._key.index + self._key_interval == frame.index:
                self._means["key_to_key"].add(self._change(self._key, frame)[0])
            self._key = frame
        self._means["noise_gain"].add(frame.noise_gain)
        self._lowest = min(self._lowest, frame.background)
        self._highest = max(self._highest, frame.background)
        self._before, self.last = frame, frame.index

    def shot(self) -> ShotFlicker:
        drift = {"background_drift": self._highest - self._lowest}
        figures = {name: mean.value for name, mean in self._means.items()} | drift
        return ShotFlicker(self._first, self.last, {name: figures[name] for name in METRICS})

    def _change(self, a: _Seen, b: _Seen) -> tuple[float, float]:
        if self._origins is not None:
            if b.index >= len(self._origins):
                raise UsageError(
                    f"the motion ends before frame {b.index}",
                    remedy="Give --motion a file with an origin for each frame of the clip.",
                )
            (xa, ya), (xb, yb) = self._origins[a.index], self._origins[b.index]
            dx_px, dy_px = (xb - xa) * b.reduction[0], (yb - ya) * b.reduction[1]
            flow, valid = flicker.known_flow(b.gain_stops.shape[:2], dx_px, dy_px)
        else:
            flow, valid = flicker.estimated_flow(b.grey, a.grey)
        gain = flicker.change_along(a.gain_stops, b.gain_stops, flow, valid)
        if a.weight is None or b.weight is None:
            return gain, math.nan
        return gain, flicker.change_along(a.weight, b.weight, flow, valid)
