"""Flicker figures against what is known; the command against a converted folder."""

from __future__ import annotations

import json
import math
from pathlib import Path

import cv2
import numpy as np
import pytest
from clips import moving_scene, write_ffv1

from itmo_video import convert, make_settings
from itmo_video.cli.main import main
from itmo_video.evaluation import flicker


def test_a_map_that_moves_with_the_picture_does_not_flicker() -> None:
    wide = cv2.GaussianBlur(
        np.random.default_rng(0).random((60, 120)).astype(np.float32), (0, 0), 3
    )
    before, after = wide[:, 10:90], wide[:, 13:93]
    flow, valid = flicker.known_flow((60, 80), 3, 0)
    assert flicker.change_along(before, after, flow, valid) == pytest.approx(0, abs=1e-6)
    still, everywhere = flicker.known_flow((60, 80), 0, 0)
    expected = float(np.abs(after - before).mean())
    assert flicker.change_along(before, after, still, everywhere) == pytest.approx(
        expected, rel=1e-5
    )


def test_estimated_flow_finds_a_pan() -> None:
    grey = cv2.GaussianBlur(np.random.default_rng(1).random((120, 220)), (0, 0), 3)
    grey = (255 * (grey - grey.min()) / np.ptp(grey)).astype(np.uint8)
    flow, valid = flicker.estimated_flow(grey[:, 14:214].copy(), grey[:, 10:210].copy())
    assert valid.mean() > 0.5
    assert np.median(flow[..., 0][valid]) == pytest.approx(4, abs=0.3)


def test_noise_gain_of_a_power_is_its_exponent() -> None:
    rng = np.random.default_rng(2)
    sdr = (0.8 * (1 + rng.normal(0, 0.01, (80, 80)))).astype(np.float32)
    assert flicker.noise_gain(sdr**2, sdr, sdr) == pytest.approx(2, rel=0.01)
    assert flicker.noise_gain(sdr * 3, sdr, sdr) == pytest.approx(1, rel=0.01)
    dark = np.full_like(sdr, 0.1)
    assert math.isnan(flicker.noise_gain(sdr, dark, dark)), "no highlights there"
    clipped = np.ones_like(sdr)
    assert math.isnan(flicker.noise_gain(sdr**2, sdr, clipped)), "a channel's grain is cut off"


def test_log_gain_and_background() -> None:
    sdr = np.array([[0.5, 0.25], [1.0, 0.0]], np.float32)
    gain = flicker.log_gain(sdr * 4, sdr)
    np.testing.assert_allclose(gain, [[2, 2], [2, 0]])
    assert flicker.background_level(gain, sdr) == pytest.approx(1)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    base = tmp_path_factory.mktemp("evaluate")
    clip = write_ffv1(base / "c.mkv", moving_scene(16, cuts=(8,)))
    settings = make_settings("paper", layers=("expand_map",), compression="none")
    convert(clip, base / "out", settings)
    return clip, base / "out"


def test_the_command_tells_each_shot(
    folder: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    clip, out = folder
    assert main(["evaluate", str(out), "--source", str(clip), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert [(s["first"], s["last"]) for s in told["shots"]] == [(1, 8), (9, 16)]
    assert told["clip"]["gain_flicker"] < 0.1
    assert told["clip"]["map_flicker"] is not None


def test_a_limit_fails_a_pipeline(folder: tuple[Path, Path]) -> None:
    command = ["evaluate", str(folder[1]), "--source", str(folder[0]), "--fail-above"]
    assert main([*command, "gain_flicker=0"]) == 7
    assert main([*command, "gain_flicker=5"]) == 0
    assert main([*command, "nope=1"]) == 2
    assert main([*command, "x"]) == 2
    assert main(["evaluate", str(folder[1])]) == 2


def test_a_sequence_equals_itself(
    folder: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    clip, out = folder
    command = ["evaluate", str(out), "--reference", str(out), "--source", str(clip), "--json"]
    assert main(command) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["fidelity"]["test"]["pq_psnr_db"] is None, "infinite, which JSON has not"
    assert told["fidelity"]["test"]["visible_share"] == 0
    assert told["fidelity"]["SDR as it is"]["visible_share"] > 0
