"""Clips whose true radiance is known: a window that pans over an HDR panorama or image.

Truth is linear BT.709 RGB; 1.0 is the radiance that just reaches SDR white. The SDR film is what a
camera with a fixed exposure makes of it: noise, clipping, sRGB in 8 bits, H.264 4:2:0 at CRF 16.
"""

from __future__ import annotations

import dataclasses
import json
import math
import shutil
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import numpy.typing as npt

from itmo_video import read_exr
from itmo_video.colour import primaries, transfer
from itmo_video.colour.primaries import LUMINANCE_WEIGHTS_BT709
from itmo_video.output.exr import ExrHeader, write_exr

SUFFIXES = (".hdr", ".exr", ".pic")
MAX_RADIANCE = 6e4  # what half float holds

Picture = npt.NDArray[np.float32]


@dataclass(frozen=True)
class ClipSpec:
    """How a clip is taken; `white_percentile` of the luminance of all frames comes out as white.

    The window starts at `start`, a share of the room to the left of and above it, and moves by
    `pan_px` a frame; it wraps around panoramas and turns back at the sides of other pictures.
    """

    frames: int = 12
    width: int = 480
    height: int = 270
    white_percentile: float = 94.0
    noise: float = 0.004
    start: tuple[float, float] = (0.3, 0.45)
    pan_px: tuple[float, float] = (2.5, 0.3)
    seed: int = 0


@dataclass(frozen=True)
class KnownClip:
    """A clip on the disk: the SDR film and the folder of the truth."""

    name: str
    film: Path
    truth: Path


def find_pictures(places: list[Path]) -> dict[str, Path]:
    """HDR pictures by name, sorted: files, and those that lie in folders."""
    files = [f for p in places for f in (sorted(p.iterdir()) if p.is_dir() else [p])]
    found = {f.stem: f for f in files if f.suffix.lower() in SUFFIXES}
    return dict(sorted(found.items()))


def make_clip(picture: Path, folder: Path, spec: ClipSpec) -> KnownClip:
    """The clip of a picture, made once for each spec; what was not finished is made anew."""
    clip = KnownClip(picture.stem, folder / "sdr.mkv", folder / "truth")
    told = json.dumps(dataclasses.asdict(spec), sort_keys=True)
    done = folder / "spec.json"
    if done.exists() and done.read_text() == told:
        return clip
    shutil.rmtree(folder, ignore_errors=True)
    clip.truth.mkdir(parents=True)
    scene = _read(picture)
    spec = _fitting(spec, scene)
    windows = [_window(scene, spec, *_origin(n, scene, spec)) for n in range(spec.frames)]
    light = np.stack([w @ np.array(LUMINANCE_WEIGHTS_BT709, np.float32) for w in windows])
    white = max(float(np.percentile(light, spec.white_percentile)), 1e-6)
    truths = [np.minimum(w / np.float32(white), MAX_RADIANCE) for w in windows]
    for number, truth in enumerate(truths, 1):
        planes = truth.astype(np.float16)
        header = _header(picture.name)
        write_exr(
            clip.truth / f"frame.{number:04d}.exr",
            (planes[..., 0], planes[..., 1], planes[..., 2]),
            header,
        )
    _film(clip.film, truths, spec)
    done.write_text(told)
    return clip


def _read(path: Path) -> Picture:
    if path.suffix.lower() == ".exr":
        channels = read_exr(path).channels
        rgb = np.dstack([channels[name].astype(np.float32) for name in "RGB"])
    else:
        bgr = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        if bgr is None:
            raise SystemExit(f"{path} cannot be read")
        rgb = bgr[..., ::-1].astype(np.float32)
    return np.clip(np.nan_to_num(rgb, posinf=MAX_RADIANCE), 0, MAX_RADIANCE)


def _fitting(spec: ClipSpec, scene: Picture) -> ClipSpec:
    """A window no larger than the picture, of even size."""
    height, width = scene.shape[:2]
    scale = min(1.0, width / spec.width, height / spec.height)
    even = [2 * math.floor(scale * n / 2) for n in (spec.width, spec.height)]
    return dataclasses.replace(spec, width=even[0], height=even[1])


def _is_panorama(scene: Picture) -> bool:
    return bool(scene.shape[1] == 2 * scene.shape[0])


def _origin(n: int, scene: Picture, spec: ClipSpec) -> tuple[float, float]:
    height, width = scene.shape[:2]
    room = (width - spec.width, height - spec.height)
    x, y = (room[i] * spec.start[i] + n * spec.pan_px[i] for i in (0, 1))
    return (x if _is_panorama(scene) else _back_and_forth(x, room[0])), _back_and_forth(y, room[1])


def _back_and_forth(at: float, room: float) -> float:
    if room <= 0:
        return 0.0
    at %= 2 * room
    return min(at, 2 * room - at)


def _window(scene: Picture, spec: ClipSpec, x: float, y: float) -> Picture:
    columns, rows = np.meshgrid(
        np.arange(spec.width, dtype=np.float32) + np.float32(x),
        np.arange(spec.height, dtype=np.float32) + np.float32(y),
    )
    window = cv2.remap(scene, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
    return np.maximum(np.asarray(window, np.float32), 0)


def _header(name: str) -> ExrHeader:
    rx, ry, gx, gy, bx, by, wx, wy = primaries.CHROMATICITIES["rec709"]
    return ExrHeader(
        "zips", (rx, ry, gx, gy, bx, by, wx, wy), 203.0, Fraction(24), Fraction(1),
        Fraction(0), name, "",
    )  # fmt: skip


def _film(path: Path, truths: list[Picture], spec: ClipSpec) -> None:
    rng = np.random.default_rng(spec.seed)
    with av.open(str(path), "w") as box:
        stream: Any = box.add_stream("libx264", rate=24, options={"crf": "16"})
        stream.width, stream.height, stream.pix_fmt = spec.width, spec.height, "yuv420p"
        context = stream.codec_context
        # H.273: BT.709 primaries and matrix, sRGB transfer, limited range.
        context.color_primaries, context.color_trc, context.colorspace = 1, 13, 1
        context.color_range = 1
        for n, truth in enumerate(truths):
            # Photon noise grows with the root of the light; some remains in the dark.
            grain = np.sqrt(np.clip(truth, 0, 1) + 0.02) * rng.normal(0, spec.noise, truth.shape)
            code = transfer.inverse_eotf(np.clip(truth + grain, 0, 1), "srgb")
            frame = av.VideoFrame.from_ndarray(np.rint(code * 255).astype(np.uint8), "rgb24")
            frame = frame.reformat(
                format="yuv420p", dst_colorspace="ITU709", dst_color_range="MPEG"
            )
            frame.pts = n
            box.mux(stream.encode(frame))
        box.mux(stream.encode(None))
