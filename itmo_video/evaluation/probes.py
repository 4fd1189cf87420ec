"""`evaluate --ibl`: a scene lit by a converted panorama, its SDR and the naive expansion.

Each is compared with the scene lit by the true panorama. Needs the extra `ibl`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import astuple, dataclass
from itertools import repeat
from pathlib import Path

import cv2
import numpy as np

from itmo_video.errors import InputError
from itmo_video.evaluation import ibl
from itmo_video.evaluation.folders import (
    ExrSequence,
    frame_rgb,
    open_sequence,
    open_source,
    pair,
    read_rgb,
)
from itmo_video.look import make_look
from itmo_video.model import Float32, Frame
from itmo_video.presets import make_settings
from itmo_video.rendering.frame import render
from itmo_video.settings import Settings
from itmo_video.source.files import MAX_PIXELS
from itmo_video.source.opening import frames_at

TEST, SDR, NAIVE = "test", "LDR probe", "naive"
SIZE = (512, 256)  # of the panoramas that light the scene, at most
_ASPECT_TOLERANCE = 0.02
_Side = ExrSequence | Path  # a folder, or a file by itself


def compare_lights(
    test: Path, reference: Path, source: Path | None, max_pixels: int = MAX_PIXELS
) -> dict[str, ibl.Lighting]:
    """Mean agreement of renders over frames, by row: TEST, and with the SDR clip SDR and NAIVE.

    `test` and `reference` are folders of EXR files, or one .exr or .hdr file; 1.0 is SDR white in
    both. The row NAIVE is Landis's operator at the L'max that `test` was made with. Raises
    InputError if they do not match or are not latitude-longitude panoramas, UsageError unless
    Mitsuba is installed.
    """
    ibl.require_mitsuba()  # so that it fails at once
    found: dict[str, list[ibl.Lighting]] = {}
    for lights, truth in _lights(_opened(test), _opened(reference), source, max_pixels):
        lit = ibl.render_lit(truth)
        for name, light in lights.items():
            found.setdefault(name, []).append(ibl.compare_lit(ibl.render_lit(light), lit))
    return {name: _mean(frames) for name, frames in found.items()}


def _lights(
    test: _Side, reference: _Side, source: Path | None, max_pixels: int
) -> Iterator[tuple[dict[str, Float32], Float32]]:
    """The panoramas of each frame by row, and the true one, ready to light the scene."""
    pairs = _pairs(test, reference)
    originals: Iterable[Frame | None] = repeat(None)
    sequence = None if isinstance(test, Path) else test
    settings = Settings() if sequence is None else sequence.settings_or_default
    if source is not None:
        clip = open_source(source, sequence, max_pixels)
        originals = frames_at(clip, [index for index, _, _ in pairs])
    for (_, test_picture, true_picture), original in zip(pairs, originals, strict=False):
        lights = {}
        if original is not None:
            lights[SDR] = _fitted(frame_rgb(original), str(source))
            lights[NAIVE] = _fitted(_naive(original, settings), str(source))
        lights[TEST] = _fitted(test_picture.rgb(), str(test_picture.path))
        yield lights, _fitted(true_picture.rgb(), str(true_picture.path))


@dataclass(frozen=True)
class _Picture:
    """A file, alone or of a sequence."""

    path: Path
    sequence: ExrSequence | None = None
    number: int = 0

    def rgb(self) -> Float32:
        """Linear BT.709 RGB of an .exr or .hdr file, (H, W, 3)."""
        if self.sequence is not None:
            return self.sequence.rgb(self.number)
        if self.path.suffix.lower() != ".hdr":
            return read_rgb(self.path)
        picture = cv2.imread(str(self.path), cv2.IMREAD_UNCHANGED)
        if picture is None or picture.ndim != 3:
            raise InputError("not a Radiance picture", where=str(self.path))
        return np.asarray(picture[..., 2::-1], np.float32)


def _opened(path: Path) -> _Side:
    return open_sequence(path) if path.is_dir() else path


def _pairs(test: _Side, reference: _Side) -> list[tuple[int, _Picture, _Picture]]:
    """The source frame's index, the picture and the true one; a single file is one frame."""
    if isinstance(test, ExrSequence) and isinstance(reference, ExrSequence):
        return [
            (
                p.index,
                _Picture(p.test, test, p.number),
                _Picture(p.truth, reference, p.true_number),
            )
            for p in pair(test, reference)
        ]
    (index, one), (_, true) = _only(test), _only(reference)
    return [(index, one, true)]


def _only(side: _Side) -> tuple[int, _Picture]:
    """Index and file of the only picture: the file itself, or the only one of a folder."""
    if isinstance(side, Path):
        return 0, _Picture(side)
    if len(side.files) > 1:
        raise InputError(
            f"has {len(side.files)} pictures, but the other side is one file", where=str(side.path)
        )
    ((number, path),) = side.files.items()
    return number - side.first_number, _Picture(path, side, number)


def _naive(frame: Frame, settings: Settings) -> Float32:
    look = make_look(
        make_settings(
            "paper",
            operator="landis2002",
            expand_map=False,
            l_max=settings.l_max_effective,
            over_white=settings.over_white,
        )
    )
    return np.dstack(render(frame, None, look).rgb).astype(np.float32)


def _fitted(rgb: Float32, where: str) -> Float32:
    """A panorama at the size used for lighting; area-averaged, which preserves its light."""
    height, width = rgb.shape[:2]
    if abs(width / (2 * height) - 1) > _ASPECT_TOLERANCE:
        raise InputError(
            f"not a latitude-longitude panorama: {width}x{height} is not 2:1", where=where
        )
    if not np.isfinite(rgb).all():
        raise InputError("has pixels that are not numbers (NaN)", where=where)
    if width > SIZE[0]:
        rgb = np.asarray(cv2.resize(rgb, SIZE, interpolation=cv2.INTER_AREA), np.float32)
    return np.maximum(rgb, 0)


def _mean(frames: list[ibl.Lighting]) -> ibl.Lighting:
    error, exposed, sharpness, depth = (
        np.mean(part, axis=0) for part in zip(*map(astuple, frames), strict=True)
    )
    return ibl.Lighting(
        float(error),
        float(exposed),
        (float(sharpness[0]), float(sharpness[1])),
        (float(depth[0]), float(depth[1])),
    )
