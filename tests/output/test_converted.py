"""A converted folder opened to be read, and those that read one: reports and previews."""

from __future__ import annotations

import json
import re
import sys
import weakref
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from clips import moving_scene, write_ffv1

from itmo_video import analyse, convert, make_settings
from itmo_video.cli.main import main
from itmo_video.conversion.run_options import RunOptions
from itmo_video.delivery import sdr
from itmo_video.delivery.from_folder import from_folder
from itmo_video.delivery.hdr import Light
from itmo_video.errors import InputError
from itmo_video.html_report.measure import FrameFacts, Measured, film_facts
from itmo_video.html_report.page import REPORT_NAME
from itmo_video.output.converted import find_converted, open_converted
from itmo_video.output.manifest import MANIFEST_NAME
from itmo_video.source.files import MAX_PIXELS


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_ffv1(tmp_path_factory.mktemp("clip") / "clip.mkv", moving_scene(16, cuts=(6,)))


@pytest.fixture(scope="module")
def shots(clip: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder whose second shot has a peak of its own; its first frame is number 101."""
    found = analyse(clip, start_number=101)
    first, second = found.shots
    edited = replace(found, shots=(first, replace(second, own={"peak_nits": 600.0})))
    out = tmp_path_factory.mktemp("shots") / "out"
    convert(
        clip, out, make_settings(peak_nits=400.0), RunOptions(start_number=101, analysis=edited)
    )
    return out


def test_settings_are_those_of_each_shot(shots: Path) -> None:
    folder = open_converted(shots)
    assert folder.numbers == list(range(101, 117))
    assert folder.index_of(101) == 0
    assert folder.settings_of(106).l_max_effective == pytest.approx(400 / 203)
    assert folder.settings_of(107).l_max_effective == pytest.approx(600 / 203)
    assert folder.peak_nits == pytest.approx(600), "the film's peak is its brightest shot's"
    assert folder.frame_rate == 24
    assert folder.time_s(103, folder.first_image) == 0, "a frame's own stamp"


def test_a_later_versions_settings_are_no_obstacle(shots: Path, tmp_path: Path) -> None:
    manifest = json.loads((shots / MANIFEST_NAME).read_text())
    manifest["settings"]["of_a_later_version"] = 7
    (tmp_path / MANIFEST_NAME).write_text(json.dumps(manifest))
    found = find_converted(tmp_path)
    assert found is not None
    assert found.settings == open_converted(shots).settings
    with pytest.raises(InputError, match="no frame"):
        open_converted(tmp_path)


@pytest.mark.parametrize("shots_told", [7, [[1, 2]], [[0, 3, {"strength": 5}]], [["a", 3, {}]]])
def test_a_manifest_of_nonsense_is_an_input_error(
    shots: Path, tmp_path: Path, shots_told: Any
) -> None:
    manifest = json.loads((shots / MANIFEST_NAME).read_text())
    manifest["settings"]["shots"] = shots_told
    (tmp_path / MANIFEST_NAME).write_text(json.dumps(manifest))
    with pytest.raises(InputError, match="manifest is invalid") as refused:
        find_converted(tmp_path)
    assert MANIFEST_NAME in str(refused.value.remedy)


def test_nobodys_folder_is_told(tmp_path: Path) -> None:
    assert find_converted(tmp_path) is None
    with pytest.raises(InputError, match="not a converted folder"):
        open_converted(tmp_path)


@pytest.mark.parametrize(
    "own", [{"fps": "10"}, {"transfer": "gamma22"}, {"range": "limited", "fps": "36"}]
)
def test_the_source_is_read_as_it_was_then(clip: Path, tmp_path: Path, own: dict[str, Any]) -> None:
    """With no expansion at all each result is its source: the two must be the same picture."""
    convert(clip, tmp_path / "o", make_settings(strength=0.0, noise_guard=False, **own))
    folder = open_converted(tmp_path / "o")

    def off(picture: Any) -> float:
        shown = np.dstack([np.asarray(plane, np.float32) for plane in picture.rgb])
        return float(np.abs(shown - sdr.source_picture(picture.source)).max())

    worst = list(from_folder(folder, clip, RunOptions()).mapped(off))
    assert len(worst) == len(folder.files)
    assert max(worst) < 2e-3, "another picture stands beside the result"


def test_another_clip_is_refused(shots: Path, tmp_path: Path) -> None:
    other = write_ffv1(tmp_path / "other.mkv", moving_scene(16, seed=3))
    with pytest.raises(InputError, match="not the clip"):
        open_converted(shots).open_source(other, MAX_PIXELS)


def test_report_of_a_folder_with_shots(shots: Path, clip: Path, tmp_path: Path) -> None:
    output = tmp_path / "page.html"
    command = ["report", str(shots), "--source", str(clip), "--output", str(output), "--quiet"]
    assert main(command) == 0
    text = output.read_text("utf-8")
    assert re.search(r"frames 107-116\W.*peak-nits 600", text, re.DOTALL), "the shot is not told"
    assert "peak 600 nits" in text


def test_convert_reports_with_an_analysis(clip: Path, tmp_path: Path) -> None:
    assert main(["analyse", str(clip), "--output", str(tmp_path / "a.json"), "--quiet"]) == 0
    found = json.loads((tmp_path / "a.json").read_text())
    found["shots"][1]["enabled"] = False
    (tmp_path / "a.json").write_text(json.dumps(found))
    out = tmp_path / "out"
    command = ["convert", str(clip), str(out), "--analysis", str(tmp_path / "a.json"), "--report"]
    assert main([*command, "--quiet"]) == 0
    assert (out / REPORT_NAME).is_file()


def test_a_damaged_clip_has_its_report(clip: Path, tmp_path: Path) -> None:
    short = tmp_path / "short.mkv"
    short.write_bytes(clip.read_bytes()[: clip.stat().st_size * 2 // 3])
    out = tmp_path / "out"
    assert main(["convert", str(short), str(out), "--report", "--quiet"]) == 4
    assert (out / REPORT_NAME).is_file()


def test_a_missing_template_engine_is_told_before_rendering(
    clip: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "jinja2", None)
    assert main(["convert", str(clip), str(tmp_path / "out"), "--report", "--quiet"]) == 2
    assert not (tmp_path / "out").exists(), "frames were rendered for a report that cannot be"


def test_a_film_of_any_length_is_measured_with_few_pictures_held() -> None:
    alive: weakref.WeakSet[Measured] = weakref.WeakSet()
    most = 0
    rng = np.random.default_rng(0)
    picture = rng.uniform(0, 1, (90, 160)).astype(np.float32)

    def frames() -> Iterator[Measured]:
        nonlocal most
        for n in range(60):
            facts = FrameFacts(
                n, n + 1, Fraction(n, 24), Light(1.0, 1.0), 1.0, 1.0, (1.0,) * 4, 0.0, 0, 0.5
            )
            grey = np.roll(np.uint8(picture * 255), n, axis=1)
            made = Measured(facts, np.ones(60), picture, picture, grey, picture[:18, :32])
            alive.add(made)
            most = max(most, len(alive))
            yield made
            del made

    facts = film_facts(frames(), 5)
    assert len(facts.frames) == 60
    assert facts.map_flicker is not None
    assert most < 15, f"{most} frames' pictures were held at a time"
