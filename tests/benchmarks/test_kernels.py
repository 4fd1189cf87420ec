"""Kernels in megapixels a second: python -m pytest tests/benchmarks --benchmark-enable."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import cv2
import numpy as np
import pytest
from clips import film_encoding

from itmo_video.colour.analysis_picture import analysis_guide, grey_of
from itmo_video.colour.luminance import frame_luminance
from itmo_video.expand_map.key_map import make_key_map
from itmo_video.look import make_look
from itmo_video.model import Frame
from itmo_video.motion import flow
from itmo_video.presets import make_settings
from itmo_video.rendering.frame import render
from itmo_video.rendering.guidance import Guidance

SIZES = {"540p": (960, 540), "1080p": (1920, 1080), "2160p": (3840, 2160)}


def frame_of(size: str, depth: int) -> Frame:
    """A moving, noisy picture with lamps as 4:2:0 codes."""
    width, height = SIZES[size]
    rng = np.random.default_rng(0)
    ground = cv2.GaussianBlur(rng.random((height, width), np.float32), (0, 0), 8)
    for x, y, r in rng.integers((0, 0, 3), (width, height, 40), (40, 3)):
        cv2.circle(ground, (int(x), int(y)), int(r), 1.0, -1)
    ground += rng.normal(0, 0.005, ground.shape).astype(np.float32)
    step = 2 ** (depth - 8)
    luma = np.round(np.clip(16 + 219 * ground, 16, 235) * step)
    chroma = np.full((height // 2, width // 2), 128 * step)
    encoding = film_encoding(bit_depth=depth)
    planes = (luma, chroma, chroma + step)
    stored = tuple(p.astype(np.uint8) if depth == 8 else p.astype(np.uint16) for p in planes)
    return Frame(0, Fraction(0), stored, encoding)


@pytest.fixture(autouse=True)
def one_thread() -> None:
    cv2.setNumThreads(1)


def record(benchmark: Any, size: str) -> None:
    width, height = SIZES[size]
    if benchmark.stats:
        benchmark.extra_info["MP/s"] = round(width * height / 1e6 / benchmark.stats["median"], 1)


@pytest.mark.parametrize("depth", [8, 10])
@pytest.mark.parametrize("size", sorted(SIZES))
class TestKernels:
    def test_linear_light(self, benchmark: Any, size: str, depth: int) -> None:
        frame = frame_of(size, depth)
        assert benchmark(frame_luminance, frame).max() > 0.9
        record(benchmark, size)

    def test_key_map(self, benchmark: Any, size: str, depth: int) -> None:
        look, frame = make_look(make_settings()), frame_of(size, depth)
        assert benchmark(make_key_map, frame, look).max() > 0
        record(benchmark, size)

    def test_track(self, benchmark: Any, size: str, depth: int) -> None:
        grey = grey_of(analysis_guide(frame_of(size, depth), 512))
        side = (np.roll(grey, 3, axis=1), np.zeros(grey.shape, np.float32))
        assert benchmark(flow.track_map, grey, side, side, 0.4).shape == grey.shape
        record(benchmark, size)

    def test_guidance(self, benchmark: Any, size: str, depth: int) -> None:
        look, frame = make_look(make_settings()), frame_of(size, depth)
        small = np.random.default_rng(1).random((288, 512), np.float32)
        guide = analysis_guide(frame, 512)

        def all_rows() -> Any:
            guidance = Guidance(frame, guide, look.settings, small, True)
            return [guidance.rows(slice(y, y + 36))[0] for y in range(0, frame.size[1], 36)]

        assert benchmark(all_rows)[0][0].shape[1] == frame.size[0]
        record(benchmark, size)

    def test_render(self, benchmark: Any, size: str, depth: int) -> None:
        look, frame = make_look(make_settings()), frame_of(size, depth)
        small = np.random.default_rng(1).random((288, 512, 4), np.float32)
        assert benchmark(render, frame, small, look).rgb[0].dtype == np.float16
        record(benchmark, size)
