"""Clips made for tests: written losslessly by PyAV from arrays of codes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
import numpy.typing as npt

from itmo_video.model import ChromaSiting, Encoding, Family, Range

REPOSITORY = Path(__file__).resolve().parents[1]
SAMPLES = REPOSITORY / "sample_clips"
SHARED = REPOSITORY.parent / "shared"


def film_encoding(
    family: Family = "ycbcr",
    bit_depth: int = 8,
    *,
    siting: ChromaSiting = "left",
    code_range: Range = "limited",
) -> Encoding:
    """An SDR film's: BT.709, BT.1886."""
    return Encoding(family, bit_depth, "bt709", code_range, "bt1886", "rec709", siting)


def still_encoding(family: Family = "rgb") -> Encoding:
    """An SDR still's: sRGB, 8 bits."""
    return Encoding(family, 8, "bt709", "full", "srgb", "rec709")


def write_ffv1(
    path: Path,
    frames: Iterable[npt.NDArray[np.uint8]],
    *,
    pixel_format: str = "rgb24",
    stored: str = "bgr0",
    fps: int = 24,
) -> Path:
    """A lossless clip of RGB or grey frames, (H, W, 3) or (H, W) uint8."""
    with av.open(str(path), "w") as box:
        stream = None
        for i, codes in enumerate(frames):
            if stream is None:
                stream = box.add_stream("ffv1", rate=Fraction(fps))
                stream.width, stream.height = codes.shape[1], codes.shape[0]
                stream.pix_fmt = stored
                stream.codec_context.thread_count = 1
            frame = av.VideoFrame.from_ndarray(codes, pixel_format)
            frame.pts = i
            box.mux(stream.encode(frame))
        assert stream is not None
        box.mux(stream.encode())
    return path


def write_film(
    path: Path,
    frames: Iterable[npt.NDArray[np.uint8]],
    *,
    fps: int = 25,
    sound: Sequence[str] = (),
    sound_s: float = 2,
) -> Path:
    """An H.264 film 4:2:0 of RGB frames, with a tone of `sound_s` seconds by each codec."""
    with av.open(str(path), "w") as box:
        first, *others = frames
        stream = box.add_stream("libx264", rate=Fraction(fps))
        stream.height, stream.width = first.shape[:2]
        stream.pix_fmt = "yuv420p"
        stream.codec_context.thread_count = 1
        tones: list[Any] = [box.add_stream(codec, rate=48000, layout="mono") for codec in sound]
        for i, codes in enumerate((first, *others)):
            frame = av.VideoFrame.from_ndarray(codes, "rgb24").reformat(format="yuv420p", threads=1)
            frame.pts = i
            box.mux(stream.encode(frame))
        box.mux(stream.encode())
        for tone in tones:
            for start in range(0, round(48000 * sound_s) - 1023, 1024):
                wave = 0.3 * np.sin(2 * np.pi * 440 / 48000 * np.arange(start, start + 1024))
                samples = av.AudioFrame.from_ndarray(wave[None].astype(np.float32), "fltp", "mono")
                samples.sample_rate, samples.pts = 48000, start
                box.mux(tone.encode(samples))
            box.mux(tone.encode())
    return path


def write_noise(path: Path, codec: str, count: int, *, seed: int) -> Path:
    """A film 4:2:0 of white noise, 160x96 at 25 fps: packets that fill the file evenly."""
    noise = np.random.default_rng(seed)
    with av.open(str(path), "w") as box:
        stream: Any = box.add_stream(codec, rate=25)
        stream.width, stream.height, stream.pix_fmt = 160, 96, "yuv420p"
        for index in range(count):
            frame = av.VideoFrame.from_ndarray(noise.integers(0, 256, (96, 160, 3), np.uint8))
            frame.pts = index
            box.mux(stream.encode(frame))
        box.mux(stream.encode())
    return path


def moving_scene(
    count: int, *, width: int = 96, height: int = 64, cuts: tuple[int, ...] = (), seed: int = 0
) -> Iterable[npt.NDArray[np.uint8]]:
    """Frames of bright discs over a textured ground that pans; another scene from each cut on."""
    y, x = np.mgrid[0:height, 0:width].astype(np.float64)
    scene = -1
    rng = np.random.default_rng(seed)
    discs: npt.NDArray[np.float64] = np.zeros((0, 3))
    tone, phase = 0.0, 0.0
    for n in range(count):
        now = sum(n >= cut for cut in cuts)
        if now != scene:
            scene = now
            rng = np.random.default_rng((seed, scene))
            discs = rng.uniform((0, 0, 4), (width, height, 10), (5, 3))
            tone, phase = 0.15 + 0.22 * (scene % 3), rng.uniform(0, 6)
        ground = tone + 0.1 * np.sin((x + 1.5 * n) / 7 + phase) * np.cos(y / 5 + phase)
        for cx, cy, r in discs:
            ground += np.clip(r - np.hypot(x + 1.5 * n - cx - 20, y - cy), 0, 1) * 0.9
        noise = np.random.default_rng((seed, 7, n)).normal(0, 0.004, ground.shape)
        grey = np.clip(ground + noise, 0, 1)
        yield np.round(np.dstack([grey, grey * 0.95, grey * 0.85]) * 255).astype(np.uint8)


def exr_bytes(folder: Path) -> dict[str, bytes]:
    """The EXR files of a folder by name."""
    return {path.name: path.read_bytes() for path in sorted(folder.glob("*.exr"))}
