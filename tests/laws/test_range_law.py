"""The one law: any range, any number of workers, any interruption: the same bytes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from clips import exr_bytes, moving_scene, write_ffv1

from itmo_video import RunOptions, Settings, convert, make_settings

CUTS = (17, 18, 40)
FLASHES = (25, 30, 31, 52, 55)  # some on the key grid


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    frames = list(moving_scene(64, cuts=CUTS))
    for flash in FLASHES:
        frames[flash] = np.full_like(frames[flash], 250)
    return write_ffv1(tmp_path_factory.mktemp("clip") / "scene.mkv", frames)


def small(preset: str, **overrides: object) -> Settings:
    return make_settings(preset, lights=64, radius=64, compression="none", **overrides)


@pytest.fixture(scope="module", params=["paper", "default", "blend", "per-frame"])
def whole(
    request: pytest.FixtureRequest, clip: Path, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Settings, dict[str, bytes]]:
    settings = {
        "paper": small("paper"),
        "default": small("default"),
        "blend": small("paper", temporal="blend"),
        "per-frame": small("paper", temporal="per-frame"),
    }[request.param]
    out = tmp_path_factory.mktemp("whole")
    convert(clip, out, settings, RunOptions(jobs=2))
    return settings, exr_bytes(out)


RANGES = [
    "1",
    "18-31",
    "16-20",
    "17",
    "18",
    "19",
    "36-44",
    "41",
    "40-40",
    "60-64",
    "64",
    "2-63x7",
    "26-33",
    "56",
    "54-57",
]


def test_any_range_gives_the_bytes_of_the_whole_run(
    clip: Path, whole: tuple[Settings, dict[str, bytes]], tmp_path: Path
) -> None:
    settings, expected = whole
    for text in RANGES:
        out = tmp_path / text
        convert(clip, out, settings, RunOptions(frames=text, jobs=1))
        made = exr_bytes(out)
        assert made, f"--frames {text} made nothing"
        wrong = [name for name, data in made.items() if expected[name] != data]
        assert not wrong, f"--frames {text} differs from the whole run in {wrong}"


def test_one_job_gives_the_bytes_of_two(
    clip: Path, whole: tuple[Settings, dict[str, bytes]], tmp_path: Path
) -> None:
    settings, expected = whole
    convert(clip, tmp_path, settings, RunOptions(jobs=1))
    assert exr_bytes(tmp_path) == expected


def test_resuming_after_losses_gives_the_same_bytes(
    clip: Path, whole: tuple[Settings, dict[str, bytes]], tmp_path: Path
) -> None:
    settings, expected = whole
    convert(clip, tmp_path, settings)
    files = sorted(tmp_path.glob("*.exr"))
    for lost in files[10:20:3]:
        lost.unlink()
    files[30].write_bytes(files[30].read_bytes()[:-100])
    files[31].write_bytes(b"")
    summary = convert(clip, tmp_path, settings)
    assert summary.written == 6, "only what is missing or damaged is made again"
    assert exr_bytes(tmp_path) == expected


def test_a_cut_shot_equals_the_shot_alone(tmp_path: Path) -> None:
    frames = list(moving_scene(50, cuts=(25,)))
    both = write_ffv1(tmp_path / "both.mkv", frames)
    alone = write_ffv1(tmp_path / "alone.mkv", frames[25:])
    settings = small("default", layers=("expand_map",))
    convert(both, tmp_path / "both", settings)
    convert(alone, tmp_path / "alone", settings)
    from itmo_video.output.exr import read_exr

    for n in range(25):
        a = read_exr(tmp_path / "both" / f"both.{n + 26:04d}.exr").channels
        b = read_exr(tmp_path / "alone" / f"alone.{n + 1:04d}.exr").channels
        for name in a:
            assert (a[name] == b[name]).all(), f"frame {n} after the cut, {name}: the shots mix"
