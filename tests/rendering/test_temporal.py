"""What must not flicker, drift or leak: made scenes through the whole default preset."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from clips import write_ffv1

from itmo_video import Settings, convert, make_settings
from itmo_video.output.exr import read_exr

Picture = npt.NDArray[np.float64]
WIDTH, HEIGHT = 320, 180


def gains(tmp_path: Path, frames: list[Picture], settings: Settings) -> list[Picture]:
    """Log2 gain of each frame of grey codes 0..255."""
    coded = [np.dstack([np.round(np.clip(f, 0, 255)).astype(np.uint8)] * 3) for f in frames]
    tmp_path.mkdir(exist_ok=True)
    clip = write_ffv1(tmp_path / "clip.mkv", coded)
    out = tmp_path / "out"
    convert(clip, out, settings)
    return [
        np.log2(read_exr(path).channels["gain.Y"].astype(np.float64))
        for path in sorted(out.glob("*.exr"))
    ]


def default(**overrides: object) -> Settings:
    return make_settings("default", layers=("gain",), compression="none", **overrides)


def room(seed: int) -> Picture:
    """A still scene with bright parts, and sensor noise that differs by seed."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    scene = 60 + 25 * np.sin(x / 23) * np.cos(y / 17)
    scene[20:60, 250:300] = 240
    scene[100:150, 20:50] = 225
    return np.asarray(scene + np.random.default_rng(seed).normal(0, 1.0, scene.shape))


@pytest.mark.parametrize(
    ("options", "most", "least"),
    [({"operator": "banterle2006", "strength": 0.15}, 0.01, 0.3), ({"footage": "clipped"}, 0.01, 0),
     ({"footage": "tone-mapped"}, 0.01, 0.3), ({}, 0.1, 0)],
)  # fmt: skip
def test_a_bright_box_that_slides_in_leaves_the_background_alone(
    tmp_path: Path, options: dict[str, Any], most: float, least: float
) -> None:
    frames = []
    for n in range(30):
        frame = room(n)
        right = 10 * (n - 11)
        if right > 0:
            frame[80:104, max(0, right - 24) : right] = 255
        frames.append(frame)
    log_gain = gains(tmp_path, frames, default(**options))
    box_size, far = 24, 4 * 24
    end = 10 * (29 - 11)
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    distance = np.maximum(np.maximum(80 - y, y - 104), 0)
    distance = np.hypot(distance, np.maximum(x - end, 0))
    background = distance > far
    assert background.sum() > 1000
    before = np.mean(log_gain[3:8], axis=0)[background].mean()
    for n in range(12, 30):
        drift = abs(log_gain[n][background].mean() - before)
        assert drift < most, f"frame {n}: the background drifts by {drift:.4f} stop"
    for n in range(14, 30):
        right = 10 * (n - 11)
        inside = log_gain[n][84:100, max(0, right - box_size + 4) : right - 4]
        assert inside.mean() >= least, f"frame {n}: the box is not expanded ({inside.mean():.2f})"


@pytest.mark.parametrize("at", [12, 13, 14, 15])
def test_a_flash_leaves_its_neighbours_alone(tmp_path: Path, at: int) -> None:
    frames = [room(n) for n in range(26)]
    calm = gains(tmp_path / "calm", frames, default())
    frames[at] = np.full((HEIGHT, WIDTH), 250.0)
    flashed = gains(tmp_path / "flash", frames, default())
    for n in (*range(at - 5, at), *range(at + 1, at + 6)):
        change = np.abs(flashed[n] - calm[n]).mean()
        assert change < 0.02, f"flash at {at}: frame {n} changes by {change:.3f} stop"


@pytest.mark.parametrize("options", [
    {"operator": "banterle2006", "expand_map": False}, {}, {"footage": "tone-mapped"},
])  # fmt: skip
@pytest.mark.parametrize("level", [0.5, 0.8, 0.95])
def test_grain_in_flat_highlights_is_not_lifted(
    tmp_path: Path, level: float, options: dict[str, Any]
) -> None:
    """Standard deviation of log2 luminance after over before: at most 1.3."""
    rng = np.random.default_rng(0)
    frames = []
    for _ in range(3):
        luminance = np.full((HEIGHT, WIDTH), level) * (1 + rng.normal(0, 0.01, (HEIGHT, WIDTH)))
        luminance[:, : WIDTH // 2] *= 0.02
        frames.append(255 * np.clip(luminance, 0, 1) ** (1 / 2.4))
    settings = make_settings(transfer="bt1886", compression="none", l_max=4.93, **options)
    coded = [np.dstack([np.round(f).astype(np.uint8)] * 3) for f in frames]
    convert(write_ffv1(tmp_path / "c.mkv", coded), tmp_path / "out", settings)
    for codes, path in zip(coded, sorted((tmp_path / "out").glob("*.exr")), strict=True):
        # Beyond the reach of the guard's windows, which keep what stands beside a strong edge.
        flat = (slice(20, 160), slice(WIDTH // 2 + 44, WIDTH - 20))
        before = np.log2((codes[..., 1][flat] / 255.0) ** 2.4)
        after = np.log2(read_exr(path).channels["G"][flat].astype(np.float64))
        noise_gain = after.std() / before.std()
        assert noise_gain <= 1.3, f"grain at {level} of white is lifted {noise_gain:.2f} times"


def test_detail_above_grain_keeps_its_contrast(tmp_path: Path) -> None:
    """The guard smooths the gain, never the picture: an edge is as sharp as it was."""
    frame = np.full((HEIGHT, WIDTH), 120.0)
    frame[:, WIDTH // 2 :] = 230
    settings = make_settings("default", transfer="srgb", expand_map=False, compression="none")
    plain = make_settings(
        "default", transfer="srgb", expand_map=False, compression="none", noise_guard=False
    )
    pictures = []
    for name, chosen in (("guarded", settings), ("plain", plain)):
        coded = [np.dstack([frame.astype(np.uint8)] * 3)]
        convert(write_ffv1(tmp_path / f"{name}.mkv", coded), tmp_path / name, chosen)
        (path,) = (tmp_path / name).glob("*.exr")
        pictures.append(read_exr(path).channels["G"].astype(np.float64))
    guarded, plain_picture = pictures
    stops = np.abs(np.log2(guarded / plain_picture))
    assert stops.max() < 0.1, f"the guard moves an edge by {stops.max():.2f} stop"
