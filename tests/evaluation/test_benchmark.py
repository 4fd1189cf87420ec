"""The benchmark of operators: its clips' truth by hand, its tables, going on where it stopped."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import cv2
import known_truth
import numpy as np
import operators_benchmark
import pytest

from itmo_video import open_clip, read_exr
from itmo_video.evaluation.folders import frame_rgb

SPEC = known_truth.ClipSpec(frames=4, width=96, height=54, white_percentile=90, noise=0.0)


@pytest.fixture(scope="module")
def panorama(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A smooth room with a lamp of 40 and a window of 6 times the wall's light."""
    path = tmp_path_factory.mktemp("hdr") / "room.hdr"
    y, x = np.mgrid[0:128, 0:256].astype(np.float32)
    light = 0.3 + 0.1 * np.sin(x / 20) * np.cos(y / 15)
    light[50:90, 60:85] = 6
    light[np.hypot(x - 110, y - 60) < 4] = 40
    rgb = light[..., None] * np.array([1.0, 0.9, 0.8], np.float32)
    assert cv2.imwrite(str(path), np.ascontiguousarray(rgb[..., ::-1]))
    return path


def _truth(clip: known_truth.KnownClip, number: int) -> Any:
    channels = read_exr(clip.truth / f"frame.{number:04d}.exr").channels
    return np.dstack([channels[name] for name in "RGB"]).astype(np.float32)


def test_the_film_is_the_truth_clipped(panorama: Path, tmp_path: Path) -> None:
    clip = known_truth.make_clip(panorama, tmp_path / "room", SPEC)
    truths = [_truth(clip, n) for n in range(1, 5)]
    light = np.stack(truths) @ np.array([0.2126, 0.7152, 0.0722], np.float32)
    assert np.percentile(light, 90) == pytest.approx(1, rel=0.01), "white is not at its percentile"
    assert light.max() > 4, "the lamp is lost"
    with open_clip(clip.film) as film:
        frames = [frame_rgb(frame) for frame in film.frames()]
    assert len(frames) == 4
    for frame, truth in zip(frames, truths, strict=True):
        assert np.abs(frame - np.clip(truth, 0, 1)).mean() < 0.01


def test_the_window_moves_as_told(panorama: Path, tmp_path: Path) -> None:
    """2.5 px a frame: two frames are 5 px apart, and nothing is interpolated between."""
    spec = known_truth.ClipSpec(
        frames=3, width=96, height=54, pan_px=(2.5, 0.0), start=(0.3125, 0.5)
    )
    clip = known_truth.make_clip(panorama, tmp_path / "room", spec)
    np.testing.assert_allclose(_truth(clip, 1)[:, 5:], _truth(clip, 3)[:, :-5], rtol=2e-3)


def test_a_small_picture_has_a_small_window(tmp_path: Path) -> None:
    picture = np.ones((41, 51, 3), np.float32)
    picture[:8] = 3
    cv2.imwrite(str(tmp_path / "small.hdr"), picture)
    clip = known_truth.make_clip(tmp_path / "small.hdr", tmp_path / "out", SPEC)
    assert _truth(clip, 1).shape == (28, 50, 3)


def _run(monkeypatch: pytest.MonkeyPatch, *args: str) -> None:
    monkeypatch.setattr(sys, "argv", ["benchmark", *args])
    operators_benchmark.main()


def test_the_tables_and_going_on(
    panorama: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    told = tmp_path / "told.json"
    command = [str(panorama), "--work", str(tmp_path / "work"), "--json", str(told), "--size",
               "96x54", "--frames", "3", "--presets", "default", "--operators", "landis2002",
               "--variant", "mild: paper; strength=0.25"]  # fmt: skip
    _run(monkeypatch, *command)
    text = capsys.readouterr().out
    rows = json.loads(told.read_text())
    assert list(rows) == ["SDR as it is", "preset default", "landis2002", "mild"]
    figures = {label: row["room"]["pq_psnr_db"] for label, row in rows.items()}
    assert len(set(figures.values())) == 4
    gain = figures["mild"] - figures["SDR as it is"]
    assert f"| mild | {figures['mild']:.2f} | {gain:+.2f} | {gain:+.2f} to {gain:+.2f} |" in text
    (work,) = (tmp_path / "work").glob("*/room")
    clip = known_truth.KnownClip("room", work / "sdr.mkv", work / "truth")
    truth = np.stack([_truth(clip, n) for n in range(1, 4)])
    clipped = truth.max(axis=-1) >= 1
    light = [np.clip(truth, 0, top)[clipped] @ [0.2126, 0.7152, 0.0722] for top in (1, np.inf)]
    expected = 1 - light[0].sum() / light[1].sum()
    assert rows["SDR as it is"]["room"]["clipped_error"] == pytest.approx(expected, abs=0.01)

    def fail(*args: Any) -> None:
        raise AssertionError("measured again")

    monkeypatch.setattr(operators_benchmark, "measure", fail)
    _run(monkeypatch, *command)
    with pytest.raises(AssertionError, match="measured again"):
        _run(monkeypatch, *command, "--again", "mild")


def test_the_interval_of_a_constant_is_the_constant() -> None:
    assert operators_benchmark.interval(np.full(5, 2.0)) == (2, 2)
    low, high = operators_benchmark.interval(np.random.default_rng(1).normal(0, 1, 400))
    assert high - low == pytest.approx(2 * 1.96 / 20, rel=0.15)
