"""convert --analysis and preview --analysis: a look for each shot."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from analysis_settings import SETTINGS
from clips import exr_bytes

from itmo_video import RunOptions, convert, make_settings, read_exr
from itmo_video.analysis.model import Analysis, Shot
from itmo_video.cli.main import main
from itmo_video.delivery.from_clip import from_clip
from itmo_video.delivery.pictures import Picture
from itmo_video.errors import OutputError, UsageError
from itmo_video.events import Warned
from itmo_video.settings import Settings


@pytest.fixture(scope="module")
def plain(clip: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    out = tmp_path_factory.mktemp("plain")
    convert(clip, out, SETTINGS)
    return all_bytes(out)


def all_bytes(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def edited(analysis: Analysis, at: int, **changes: Any) -> Analysis:
    shots = list(analysis.shots)
    enabled = changes.pop("enabled", True)
    shots[at] = replace(shots[at], own=changes, enabled=enabled)
    return replace(analysis, shots=tuple(shots))


def names(first: int, last: int) -> set[str]:
    return {f"scene.{n:04d}.exr" for n in range(first, last + 1)}


def test_unedited_it_changes_nothing(
    clip: Path, found: Analysis, plain: dict[str, bytes], tmp_path: Path
) -> None:
    convert(clip, tmp_path, SETTINGS, RunOptions(analysis=found))
    assert all_bytes(tmp_path) == plain


def test_only_the_edited_shot_is_made_again(
    clip: Path, found: Analysis, plain: dict[str, bytes], tmp_path: Path
) -> None:
    convert(clip, tmp_path / "out", SETTINGS)
    other = edited(found, 2, peak_nits=400.0)
    with pytest.raises(OutputError, match="--update"):
        convert(clip, tmp_path / "out", SETTINGS, RunOptions(analysis=other))
    summary = convert(clip, tmp_path / "out", SETTINGS, RunOptions(analysis=other, update=True))
    assert summary.written == 12, "one shot has 12 frames, no others may be rendered"
    made = exr_bytes(tmp_path / "out")
    assert {n for n in made if made[n] != plain[n]} == names(19, 30)

    settings = replace(SETTINGS, peak_nits=400.0)
    convert(clip, tmp_path / "all", settings, RunOptions(frames="19-30"))
    alone = exr_bytes(tmp_path / "all")
    assert alone == {n: made[n] for n in names(19, 30)}, "not what that peak gives"

    ranged = RunOptions(frames="15-22", analysis=other)
    convert(clip, tmp_path / "ranged", SETTINGS, ranged)
    assert exr_bytes(tmp_path / "ranged") == {n: made[n] for n in names(15, 22)}, "the law"

    again = convert(clip, tmp_path / "out", SETTINGS, RunOptions(analysis=found, update=True))
    assert again.written == 12, "taking the edit back renders that shot only, too"
    assert all_bytes(tmp_path / "out") == plain


def test_off_and_strength(clip: Path, found: Analysis, tmp_path: Path) -> None:
    def rgb(folder: str, number: int) -> np.ndarray:
        image = read_exr(tmp_path / folder / f"scene.{number:04d}.exr")
        return np.stack([image.channels[c] for c in "RGB"]).astype(np.float64)

    linear = make_settings("default", operator="linear", lights=64, radius=64, expand_map=False)
    variants = {
        "full": found,
        "half": edited(found, 2, strength=0.5),
        "none": edited(found, 2, strength=0.0),
        "off": edited(found, 2, enabled=False, peak_nits=4000.0),
    }
    for name, analysis in variants.items():
        run = RunOptions(frames="19,30,10", analysis=analysis)
        convert(clip, tmp_path / name, linear, run)
    assert exr_bytes(tmp_path / "off") == exr_bytes(tmp_path / "none")
    full, half, none = (rgb(name, 30) for name in ("full", "half", "none"))
    assert none.max() <= 1, "a shot that is off stays SDR"
    np.testing.assert_allclose(full, none * linear.l_max_effective, rtol=2e-3)
    np.testing.assert_allclose(half, (full + none) / 2, rtol=2e-3)
    assert (rgb("off", 10) == rgb("full", 10)).all(), "a shot's settings reach another shot"


def test_another_clips_analysis_and_values_out_of_bounds(
    clip: Path, found: Analysis, tmp_path: Path
) -> None:
    with pytest.raises(UsageError, match="another clip"):
        convert(clip, tmp_path, SETTINGS, RunOptions(analysis=replace(found, digest="0")))
    low = edited(found, 0, peak_nits=10.0)
    with pytest.raises(UsageError, match="shot 1-17: peak-nits 10 is below"):
        convert(clip, tmp_path, SETTINGS, RunOptions(analysis=low))
    assert list(tmp_path.iterdir()) == []


def test_shots_may_be_cut_by_hand(clip: Path, found: Analysis, tmp_path: Path) -> None:
    other = replace(found, shots=(Shot(3, 4, {"l_max": 2.0}), Shot(9, 9, enabled=False)))
    convert(clip, tmp_path, SETTINGS)
    summary = convert(clip, tmp_path, SETTINGS, RunOptions(analysis=other, update=True))
    assert summary.written == 3


@pytest.mark.parametrize(
    "own",
    [
        {"strength": 1.0},
        {"operator": "reinhard2002"},
        {"preset": "paper", "peak_nits": 600.0},
        {"radius": 20.0, "min_lights": 2, "soft_lights": False},
        {"key_interval": 3, "smooth_keys": 1, "map_width": 48},
        {"temporal": "per-frame"},
        {"expand_map": False, "l_max": 3.0},
    ],
)
def test_a_shot_means_what_the_command_line_means(
    clip: Path, found: Analysis, tmp_path: Path, own: dict[str, Any]
) -> None:
    """Frames of a shot are those of a clip converted with its settings, cut there or not."""
    flags: dict[str, Any] = {"lights": 64, "compression": "none", "peak_nits": 700.0}
    shots = (Shot(1, 11), Shot(12, 22, own), Shot(23, 30, enabled=False))
    analysis = replace(found, shots=shots)
    convert(clip, tmp_path / "shots", make_settings(**flags), RunOptions(analysis=analysis, jobs=3))
    of_clip = {n: v for n, v in flags.items() if n != "peak_nits" or "l_max" not in own}
    whole = make_settings(**{"preset": "default"} | of_clip | own)
    convert(clip, tmp_path / "whole", whole, RunOptions(frames="12-22"))
    made, alone = exr_bytes(tmp_path / "shots"), exr_bytes(tmp_path / "whole")
    assert [n for n in names(12, 22) if made[n] != alone[n]] == []

    ranged = RunOptions(frames="10-13", analysis=analysis)
    convert(clip, tmp_path / "ranged", make_settings(**flags), ranged)
    again = exr_bytes(tmp_path / "ranged")
    assert all(again[n] == made[n] for n in names(10, 13)), "the law"
    convert(clip, tmp_path / "base", make_settings(**flags), RunOptions(frames="1-11"))
    base = exr_bytes(tmp_path / "base")
    assert all(base[n] == made[n] for n in names(1, 11)), "a shot's settings reach another shot"


def test_settings_that_no_preset_was_asked_for_are_all_meant(found: Analysis) -> None:
    base = Settings(strength=0.5, peak_nits=600.0, operator="linear")
    assert Shot(1, 2, {"radius": 9.0}).settings(base) == replace(base, radius=9.0)
    paper = Shot(1, 2, {"preset": "paper"}).settings(base)
    assert paper == make_settings("paper", strength=0.5, peak_nits=600.0, operator="linear")
    white = make_settings(white_nits=100.0, peak_nits=150.0)
    assert Shot(1, 2, {"preset": "paper"}).settings(white).white_nits == 100
    with pytest.raises(UsageError, match="whole clip"):
        Shot(1, 2, {"compression": "rle"}).settings(base)


def test_frames_in_no_shot_are_told(clip: Path, found: Analysis, tmp_path: Path) -> None:
    told: list[Any] = []
    other = replace(found, shots=(Shot(1, 17), Shot(20, 29)), where="a.json")
    run = RunOptions(frames="15-22,30", analysis=other)
    convert(clip, tmp_path / "o", SETTINGS, run, told.append)
    warnings = [event.message for event in told if isinstance(event, Warned)]
    assert any("frames 18-19,30 are in no shot of a.json" in text for text in warnings)
    told.clear()
    convert(clip, tmp_path / "p", SETTINGS, RunOptions(frames="15-17", analysis=other), told.append)
    assert not any("no shot" in str(event) for event in told)


def test_an_analysis_at_another_rate_is_refused(
    clip: Path, found: Analysis, tmp_path: Path
) -> None:
    slower = replace(SETTINGS, fps="12")
    with pytest.raises(UsageError, match="has 30 frames, this conversion has 15"):
        convert(clip, tmp_path / "o", slower, RunOptions(analysis=found))


def test_a_preview_shows_the_shots(clip: Path, found: Analysis, tmp_path: Path) -> None:
    other = edited(found, 2, preset="paper", peak_nits=4000.0, strength=1.0)
    run = RunOptions(analysis=other, jobs=2)
    convert(clip, tmp_path, SETTINGS, run)
    pictures = from_clip(clip, SETTINGS, run)
    assert pictures.peak_nits == 4000

    def is_same(picture: Picture) -> bool:
        image = read_exr(tmp_path / f"scene.{picture.number:04d}.exr")
        return all(
            bool((image.channels[c] == p).all()) for c, p in zip("RGB", picture.rgb, strict=True)
        )

    assert list(pictures.mapped(is_same)) == [True] * 30


def test_a_folder_takes_no_settings(clip: Path, found: Analysis, tmp_path: Path) -> None:
    convert(clip, tmp_path / "o", SETTINGS)
    for more in (["--peak-nits", "500"], ["--preset", "paper"]):
        assert main(["preview", str(tmp_path / "o"), str(tmp_path / "a.mp4"), *more]) == 2
    assert not (tmp_path / "a.mp4").exists()
