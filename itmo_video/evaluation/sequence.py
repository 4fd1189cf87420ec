"""Figures of a converted folder: flicker along its clip's motion, fidelity to a true sequence."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from itmo_video import colour, keyframes
from itmo_video.errors import InputError, UsageError
from itmo_video.evaluation import fidelity, flicker
from itmo_video.exr import read_exr
from itmo_video.folder import read_manifest
from itmo_video.guide import analysis_guide, analysis_size
from itmo_video.model import Code, Float32, Float64
from itmo_video.reader import Clip, open_clip
from itmo_video.render import frame_luminance
from itmo_video.tags import InputOptions

Origins = Sequence[tuple[float, float]]
METRICS = (
    "map_flicker", "gain_flicker", "background_drift", "noise_gain", "key_to_key",
)  # fmt: skip


@dataclass
class Shot:
    """A shot's frames (first and last index) and figures; NaN where one cannot be measured."""

    first: int
    last: int
    figures: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class _Seen:
    """One frame at analysis size."""

    index: int
    grey: Code
    gain_stops: Float32
    weight: Float32 | None
    background: float
    noise_gain: float
    starts_shot: bool


def exr_files(folder: Path) -> list[Path]:
    """The EXR files of a folder in order; InputError when there are none."""
    files = sorted(folder.glob("*.exr"))
    if not files:
        raise InputError("no EXR files in it", where=str(folder))
    return files


def read_luminance(path: Path, primaries: str) -> tuple[Float32, dict[str, Any]]:
    """Luminance of an EXR, SDR white = 1, (H, W) float32, and its channels."""
    channels = read_exr(path).channels
    if not {"R", "G", "B"} <= set(channels):
        raise InputError("it has no R, G and B", where=str(path))
    weights = colour.luminance_weights(primaries)
    total = sum(w * channels[c].astype(np.float32) for w, c in zip(weights, "RGB", strict=True))
    return np.asarray(total, np.float32), channels


def flicker_by_shot(
    folder: Path, source: Path, origins: Origins | None, key_interval: int
) -> list[Shot]:
    """Flicker figures of each shot of a converted folder; by known origins or estimated flow.

    The luminances of SDR and HDR are compared, so the folder may be anybody's; map flicker needs
    the layer expand_map. Raises InputError where folder and clip do not fit.
    """
    shots: list[Shot] = []
    seen: list[_Seen] = []
    for frame in _frames(folder, source):
        if frame.starts_shot and seen:
            shots.append(_measure(seen, origins, key_interval))
            seen = []
        seen.append(frame)
    if seen:
        shots.append(_measure(seen, origins, key_interval))
    return shots


def over_shots(shots: Sequence[Shot]) -> dict[str, float]:
    """The clip's figures: means over shots by their lengths; the largest drift."""
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
    """Window origins by frame from pan_clip.py's motion.json; raises UsageError otherwise."""
    try:
        origins = json.loads(path.read_text())["origins"]
        return [(float(x), float(y)) for x, y in origins]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise UsageError(f"no origins can be read: {error}", where=str(path)) from error


def compare_sequences(
    test: Path, reference: Path, source: Path | None, white_nits: float, peak_nits: float
) -> dict[str, dict[str, float]]:
    """Mean fidelity figures by row: "test", and "SDR as it is" where the clip is given."""
    tests, truths = exr_files(test), exr_files(reference)
    if len(tests) != len(truths):
        raise InputError(f"{len(tests)} frames, the reference has {len(truths)}", where=str(test))
    rows: dict[str, list[Mapping[str, float]]] = {"test": []}
    primaries = _primaries(test)
    clip = open_clip(source) if source else None
    sdr_frames = clip.frames() if clip else None
    for test_file, truth_file in zip(tests, truths, strict=True):
        truth = _shown(read_luminance(truth_file, "rec709")[0], white_nits, peak_nits)
        shown = _shown(read_luminance(test_file, primaries)[0], white_nits, peak_nits)
        rows["test"].append(_figures(shown, truth, white_nits, str(test_file)))
        if sdr_frames is not None:
            sdr = _shown(frame_luminance(next(sdr_frames)), white_nits, peak_nits)
            rows.setdefault("SDR as it is", []).append(
                _figures(sdr, truth, white_nits, str(source))
            )
    return {
        name: {key: float(np.mean([figures[key] for figures in all_])) for key in all_[0]}
        for name, all_ in rows.items()
    }


def _figures(test: Float64, truth: Float64, white_nits: float, where: str) -> dict[str, float]:
    try:
        figures = asdict(fidelity.compare(test, truth, white_nits))
    except ValueError as error:
        raise InputError(str(error), where=where) from error
    return {name: value for name, value in figures.items() if isinstance(value, float)}


def _shown(luminance: Float32, white_nits: float, peak_nits: float) -> Float64:
    return np.clip(luminance.astype(np.float64) * white_nits, fidelity.DARKEST_NITS, peak_nits)


def _primaries(folder: Path) -> str:
    manifest = read_manifest(folder)
    return str(manifest.settings.get("primaries", "rec709")) if manifest else "rec709"


def _frames(folder: Path, source: Path) -> Iterator[_Seen]:
    primaries = _primaries(folder)
    files = iter(exr_files(folder))
    with open_clip(source, InputOptions(force_sdr=True)) as clip:
        width, height = analysis_size(*clip.info.display_size, 512)
        for placed in keyframes.place(_analysed(clip), 5, 0):
            path = next(files, None)
            if path is None:
                return
            frame = placed.analysed
            sdr = frame_luminance(frame.frame)
            hdr, channels = read_luminance(path, primaries)
            if hdr.shape != sdr.shape:
                raise InputError(f"its size is not the clip's {sdr.shape[::-1]}", where=str(path))
            gain = flicker.log_gain(hdr, sdr)
            weight = channels.get("expand_map.Y")
            yield _Seen(
                frame.index,
                frame.grey,
                _small(gain, width, height),
                None if weight is None else _small(weight.astype(np.float32), width, height),
                flicker.background_level(gain, sdr),
                flicker.noise_gain(hdr, sdr),
                placed.starts_shot,
            )


def _analysed(clip: Clip) -> Iterator[keyframes.Analysed]:
    for frame in clip.frames():
        yield keyframes.analyse_frame(frame, analysis_guide(frame, 512))


def _small(values: Float32, width: int, height: int) -> Float32:
    if values.shape == (height, width):
        return values
    return np.asarray(cv2.resize(values, (width, height), interpolation=cv2.INTER_AREA))


def _measure(seen: Sequence[_Seen], origins: Origins | None, key_interval: int) -> Shot:
    def change(a: _Seen, b: _Seen) -> tuple[float, float]:
        if origins is not None:
            if b.index >= len(origins):
                raise UsageError(f"the motion ends before frame {b.index}")
            (xa, ya), (xb, yb) = origins[a.index], origins[b.index]
            flow, valid = flicker.known_flow(b.gain_stops.shape[:2], xb - xa, yb - ya)
        else:
            flow, valid = flicker.estimated_flow(b.grey, a.grey)
        gain = flicker.change_along(a.gain_stops, b.gain_stops, flow, valid)
        if a.weight is None or b.weight is None:
            return gain, math.nan
        return gain, flicker.change_along(a.weight, b.weight, flow, valid)

    steps = [change(a, b) for a, b in pairwise(seen)]
    keys = [frame for frame in seen if frame.index % key_interval == 0]
    key_steps = [change(a, b)[0] for a, b in pairwise(keys)]
    levels = [frame.background for frame in seen]
    figures = {
        "map_flicker": _mean([weight for _, weight in steps]),
        "gain_flicker": _mean([gain for gain, _ in steps]),
        "background_drift": max(levels) - min(levels),
        "noise_gain": _mean([frame.noise_gain for frame in seen]),
        "key_to_key": _mean(key_steps),
    }
    return Shot(seen[0].index, seen[-1].index, figures)


def _mean(values: Sequence[float]) -> float:
    known = [value for value in values if not math.isnan(value)]
    return float(np.mean(known)) if known else math.nan
