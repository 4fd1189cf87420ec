"""Values that cannot be meant: wrong usage, named, at once."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from clips import moving_scene, write_ffv1

import itmo_video
from itmo_video import (
    EvaluateOptions,
    PreviewOptions,
    ReportOptions,
    RunOptions,
    Settings,
    UsageError,
    convert,
    expand,
    make_settings,
    open_clip,
    open_result,
)
from itmo_video.cli.main import main
from itmo_video.look import make_look

lib: Any = itmo_video  # called with values of other types


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_ffv1(
        tmp_path_factory.mktemp("clip") / "c.mkv", moving_scene(3, width=64, height=48)
    )


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("preview {clip} {new}.mp4 --speed foo", "Known: 0, 1, 2"),
        ("preview {clip} {new}.mp4 --speed 14", "no such preset for av1"),
        ("preview {clip} {new}.mp4 --codec hevc --speed 5", "ultrafast"),
        ("preview {clip} {new}.mov --codec prores --speed 5", "Omit --speed"),
        ("preview {clip} {new}.mp4 --as sdr --in-hdr", "in-hdr applies to --as compare only"),
        ("preview {clip} {new}.mp4 --in-hdr", "in-hdr applies to --as compare only"),
        ("preview {clip} {new}.mp4 --as compare --in-hdr --tone-map aces", "--tone-map"),
        ("preview {clip} {new}.mp4 --layout wipe", "layout applies to --as compare only"),
        (
            "preview {clip} {new}.mp4 --as compare --scale nits",
            "scale applies to --as false-colour only",
        ),
        ("convert {clip} {new} --raw yuv420p:64x48:25", "this is a file"),
        ("info {clip} --raw yuv420p:64x48:25", "this is a file"),
        ("convert - {new} --raw yuv420p:0x48:25", "raw must be"),
        ("convert - {new} --raw yuv420p:64x0:25", "raw must be"),
        ("convert - {new} --raw yuv420p:64x48:0", "raw must be"),
        ("convert - {new} --raw yuv420p:64x48:1/0", "raw must be"),
    ],
)
def test_at_the_command_line(
    line: str, told: str, clip: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if line.startswith("info"):
        line = line.replace("info {clip}", "convert {clip} {new} --dry-run")
    assert main(line.format(clip=clip, new=tmp_path / "new").split()) == 2
    error = capsys.readouterr().err
    assert told in error
    assert len(error.splitlines()) <= 2
    assert list(tmp_path.iterdir()) == []


def test_a_pattern_that_no_shell_filled_in(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cv2.imwrite(str(tmp_path / "img1.png"), np.zeros((8, 8, 3), np.uint8))
    assert main(["convert", str(tmp_path / "img*.png"), str(tmp_path / "o")]) == 3
    assert "Remove the quotes" in capsys.readouterr().err
    cv2.imwrite(str(tmp_path / "img[1].png"), np.zeros((8, 8, 3), np.uint8))
    assert main(["convert", str(tmp_path / "img[1].png"), str(tmp_path / "o"), "--quiet"]) == 0


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (
            lambda c, o: lib.convert(c, o, {"peak_nits": 600}),
            "settings must be Settings or a preset",
        ),
        (lambda c, o: lib.convert(c, o, "papyrus"), "unknown preset"),
        (lambda c, o: lib.convert(c, o, None, {"jobs": 1}), "run must be RunOptions, not dict"),
        (lambda c, o: lib.convert(None, o), "source must be a path, not NoneType"),
        (lambda c, o: lib.convert(c, None), "output must be a path"),
        (lambda c, o: lib.convert(bytes(c), o), "source must be a path, not bytes"),
        (lambda c, o: lib.preview(None, o / "a.mp4"), "source must be a path"),
        (lambda c, o: lib.preview(c, None), "output must be a path"),
        (
            lambda c, o: lib.preview(c, o / "a.mp4", options={}),
            "options must be PreviewOptions",
        ),
        (lambda c, o: lib.preview(c, o / "a.mp4", run=RunOptions), "run must be RunOptions"),
        (lambda c, o: lib.analyse(None), "source must be a path"),
        (lambda c, o: lib.analyse(c, 7), "settings must be Settings"),
        (lambda c, o: lib.report(None), "folder must be a path"),
        (lambda c, o: lib.report(o, "x"), "options must be ReportOptions"),
        (lambda c, o: lib.evaluate(o, ReportOptions()), "options must be EvaluateOptions"),
        (lambda c, o: lib.evaluate(o, None), "source"),
        (lambda c, o: lib.evaluate(None, EvaluateOptions(source=c)), "test must be a path"),
        (lambda c, o: lib.open_clip(None), "path must be a path"),
        (lambda c, o: lib.open_result(3), "folder must be a path"),
        (lambda c, o: lib.read_analysis(None), "path must be a path"),
        (lambda c, o: lib.expand(None), "not a picture"),
        (lambda c, o: lib.expand(np.zeros((8, 8, 3), np.uint8), Settings), "settings must be"),
        (lambda c, o: lib.expand(np.zeros((8, 8, 3), np.uint8), bit_depth=0), "0 bits"),
        (
            lambda c, o: lib.expand(np.zeros((8, 8, 3), np.uint8), bit_depth=True),
            "whole number",
        ),
        (lambda c, o: lib.expand(np.zeros((8, 8, 3), np.uint8), bit_depth="8"), "whole number"),
        (lambda c, o: list(lib.expand_frames(None)), "a series of arrays"),
        (
            lambda c, o: list(
                lib.expand_frames([np.zeros((8, 8, 3), np.uint8), np.zeros((8, 8, 3), np.float32)])
            ),
            "is float32, but the first is uint8",
        ),
        (
            lambda c, o: list(
                lib.expand_frames([np.zeros((8, 8, 3), np.uint16), np.zeros((8, 8, 3), np.uint8)])
            ),
            "is uint8, but the first is uint16",
        ),
    ],
)
def test_from_python(call: Any, told: str, clip: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=told):
        call(clip, tmp_path)


def test_a_presets_name_will_do(clip: Path, tmp_path: Path) -> None:
    convert(clip, tmp_path / "o", "paper")
    assert open_result(tmp_path / "o").settings.as_dict() == make_settings("paper").as_dict()
    lamp = np.full((32, 32, 3), 200, np.uint8)
    found = expand(lamp, "paper")
    np.testing.assert_array_equal(found.rgb, expand(lamp, make_settings("paper")).rgb)


def test_numbers_of_numpy_are_numbers() -> None:
    own = make_settings(peak_nits=np.float32(600), lights=np.int64(64), noise_guard=np.bool_(True))
    assert own == make_settings(peak_nits=600.0, lights=64, noise_guard=True)
    assert type(own.lights) is int
    for wrong in (np.float32("nan"), np.array([600.0]), np.complex64(1)):
        with pytest.raises(UsageError):
            make_settings(peak_nits=wrong)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("strength = 7", "strength must be from 0 to 2"),
        ("strenth = 1", "unknown setting strenth"),
        ("peak_nits = 100.0", "below white-nits"),
        ("map-width = 32\nmap_width = 64", "given twice"),
        ("strength = ", "not TOML"),
    ],
)
def test_a_presets_mistake_names_its_file(text: str, told: str, tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    path.write_text(f"[settings]\n{text}\n")
    with pytest.raises(UsageError, match=told) as caught:
        make_settings(str(path))
    assert caught.value.where == str(path)


def test_an_enormous_preset_is_refused_at_once(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    for text in ("a" * (4 << 20) + " = 1", "[settings]\n" + "a." * 60_000 + "b = 1"):
        path.write_text(text)
        began = time.process_time()
        with pytest.raises(UsageError):
            make_settings(str(path))
        assert time.process_time() - began < 2


def test_settings_without_effect_are_told(
    clip: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    line = ["convert", str(clip), str(tmp_path / "o"), "--preset", "paper", "--lamps", "0"]
    assert main([*line, "--null", "--hue", "keep"]) == 0
    told = "hue, lamps have no effect with these settings (operator banterle2006)"
    assert told in capsys.readouterr().err
    assert make_look(make_settings("paper", expand_map=False, lights=64)).notices
    unmapped = make_look(make_settings("default", expand_map=False, footage="clipped", lamps=2))
    assert unmapped.notices == (
        "footage, lamps have no effect with these settings (operator auto, no Expand Map)",
    )
    assert not {"footage", "lamps"} & unmapped.settings_in_use().keys()
    assert "hue" in unmapped.settings_in_use()
    for asked in ({}, {"lamps": 0}, {"l_max": 4}, {"peak_nits": 600}, {"layers": ["gain"]}):
        assert make_look(make_settings("default", **asked)).notices == ()
    assert make_look(make_settings("paper")).notices == ()


def test_several_inputs_are_told_apart(
    clip: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = write_ffv1(tmp_path / "other.mkv", moving_scene(2, width=64, height=48))
    assert main(["convert", str(clip), str(other), str(tmp_path / "o"), "--lights", "16"]) == 0
    for line in capsys.readouterr().err.splitlines():
        told = (clip, other, tmp_path / "o/c/", tmp_path / "o/other/")
        is_of = [
            line.startswith(f"itmo-video: {of}{name}")
            for of in ("", "1 of 2: ", "2 of 2: ")
            for name in told
        ]
        assert any(is_of), line


def test_what_is_open_says_so(clip: Path) -> None:
    with open_clip(clip) as opened:
        assert repr(opened) == f"<VideoClip '{clip}': 3 frames, 64x48>"
    assert itmo_video.PreviewOptions is PreviewOptions
