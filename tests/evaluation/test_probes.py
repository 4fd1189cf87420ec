"""evaluate --ibl: which panoramas light the scene, what is told of them, and without Mitsuba."""

from __future__ import annotations

import builtins
import json
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from clips import write_ffv1

from itmo_video import RunOptions, convert, make_settings
from itmo_video.cli.main import main
from itmo_video.errors import InputError
from itmo_video.evaluation import ibl, probes

needs_mitsuba = pytest.mark.skipif(find_spec("mitsuba") is None, reason="extra ibl is missing")
SHAPE = (64, 128)
LAMP = (slice(8, 20), slice(30, 60))


def _write_hdr(path: Path, light: float, shape: tuple[int, int] = SHAPE) -> Path:
    panorama = np.full((*shape, 3), 0.25, np.float32)
    panorama[LAMP] = light
    assert cv2.imwrite(str(path), panorama)
    return path


@pytest.fixture
def base(tmp_path: Path) -> Path:
    """A panorama of grey walls and a lamp that clips, converted at L'max 2, and the true one."""
    codes = np.full((*SHAPE, 3), 137, np.uint8)  # linear 0.25 by sRGB's curve
    codes[LAMP] = 255
    write_ffv1(tmp_path / "sdr.mkv", [codes, codes])
    settings = make_settings(
        "paper", l_max=2.0, transfer="srgb", projection="latlong", min_lights=0, radius=4.0
    )
    convert(tmp_path / "sdr.mkv", tmp_path / "out", settings)
    convert(tmp_path / "sdr.mkv", tmp_path / "one", settings, RunOptions(frames="2"))
    _write_hdr(tmp_path / "truth.hdr", 2.0)
    return tmp_path


@pytest.fixture
def lit_by_the_lamp(monkeypatch: pytest.MonkeyPatch) -> None:
    """In place of a renderer: everything is lit by the lamp's brightest pixel."""

    def render(panorama: Any) -> Any:
        return np.full((ibl.HEIGHT, ibl.WIDTH, 3), panorama.max(), np.float32)

    monkeypatch.setattr(ibl, "require_mitsuba", lambda: None)
    monkeypatch.setattr(ibl, "render_lit", render)


@pytest.mark.usefixtures("lit_by_the_lamp")
def test_rows_by_hand(base: Path) -> None:
    rows = probes.compare_lights(base / "one", base / "truth.hdr", base / "sdr.mkv")
    assert list(rows) == [probes.SDR, probes.NAIVE, probes.TEST]
    assert rows[probes.SDR].error == pytest.approx(0.5, abs=0.01), "SDR white is half the lamp"
    assert rows[probes.NAIVE].error < 0.01, "naive is not at the L'max of the test"
    assert rows[probes.TEST].error < 0.05
    same = probes.compare_lights(base / "truth.hdr", base / "truth.hdr", None)
    assert list(same) == [probes.TEST]
    assert same[probes.TEST].error == 0


@pytest.mark.usefixtures("lit_by_the_lamp")
def test_folders_are_paired_frame_by_frame(base: Path) -> None:
    rows = probes.compare_lights(base / "one", base / "out", base / "sdr.mkv")
    assert rows[probes.TEST].error == 0, "the same frame of the same conversion"
    with pytest.raises(InputError, match="2 pictures"):
        probes.compare_lights(base / "out", base / "truth.hdr", None)


@pytest.mark.usefixtures("lit_by_the_lamp")
def test_what_is_no_panorama_is_refused(base: Path) -> None:
    square = _write_hdr(base / "square.hdr", 2.0, (64, 64))
    with pytest.raises(InputError, match="64x64 is not 2:1"):
        probes.compare_lights(square, base / "truth.hdr", None)
    (base / "text.hdr").write_text("no picture")
    with pytest.raises(InputError, match="Radiance"):
        probes.compare_lights(base / "text.hdr", base / "truth.hdr", None)


@pytest.mark.usefixtures("lit_by_the_lamp")
def test_the_command_tells_and_judges(base: Path, capsys: pytest.CaptureFixture[str]) -> None:
    args = ["evaluate", str(base / "one"), "--reference", str(base / "truth.hdr"), "--ibl"]
    assert main([*args, "--source", str(base / "sdr.mkv"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["ibl"]
    assert told["LDR probe"]["light_error"] == pytest.approx(0.5, abs=0.01)
    assert set(told["test"]) == {
        "light_error", "exposed_light_error", "shadow_sharpness", "shadow_depth",
        "true_shadow_sharpness", "true_shadow_depth",
    }  # fmt: skip
    assert main([*args, "--source", str(base / "sdr.mkv"), "--fail-above", "light_error=-1"]) == 7
    out = capsys.readouterr().out
    assert [line.split("  ")[0] for line in out.splitlines()[1:]] == [
        "true probe", "LDR probe", "naive", "test",
    ]  # fmt: skip


@pytest.mark.parametrize("more", [["--vdp"], ["--motion", "m.json"], []])
def test_it_needs_a_truth_and_stands_alone(
    base: Path, more: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    args = ["evaluate", str(base / "one"), "--ibl", "--source", str(base / "sdr.mkv"), *more]
    assert main([*args, *(["--reference", str(base / "truth.hdr")] if more else [])]) == 2
    assert "--ibl compares renders" in capsys.readouterr().err


def test_without_mitsuba_it_says_what_to_install(
    base: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    real = builtins.__import__

    def without(name: str, *args: Any, **kwargs: Any) -> Any:
        if name == "mitsuba":
            raise ImportError("No module named 'mitsuba'")
        return real(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without)
    code = main(["evaluate", str(base / "one"), "--reference", str(base / "truth.hdr"), "--ibl"])
    assert code == 2
    told = capsys.readouterr().err
    assert "needs Mitsuba" in told
    assert "pip install '.[ibl]'" in told
    assert "Traceback" not in told


@needs_mitsuba
def test_a_lamp_lights_more_than_its_sdr(base: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ibl, "SAMPLES", 4)
    nearly = _write_hdr(base / "nearly.hdr", 1.8)
    rows = probes.compare_lights(nearly, base / "truth.hdr", base / "sdr.mkv")
    assert rows[probes.TEST].error < 0.35 * rows[probes.SDR].error
    assert rows[probes.SDR].error == pytest.approx(0.44, abs=0.1)
    true_depth = rows[probes.TEST].depth[1]
    assert rows[probes.SDR].depth[0] < rows[probes.TEST].depth[0] < true_depth + 0.05
