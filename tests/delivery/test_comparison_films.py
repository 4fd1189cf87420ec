"""Labels, exposure and false colour: what is written, and that nothing else is touched."""

from __future__ import annotations

import json
import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from clips import moving_scene, write_ffv1

from itmo_video.cli.main import main
from itmo_video.delivery import sdr
from itmo_video.delivery.false_colour import (
    ABOVE_WHITE,
    BELOW_WHITE,
    ROUND_NITS,
    bands,
    false_colour,
)
from itmo_video.delivery.lettering import labelled, text_mask

VIEWER = Path(sdr.__file__).parents[1] / "viewer" / "false_colour.js"


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("compare")
    return write_ffv1(folder / "c.mkv", moving_scene(1, width=480, height=270))


def still(clip: Path, path: Path, *flags: str) -> np.ndarray[tuple[int, ...], np.dtype[np.uint8]]:
    assert main(["preview", str(clip), str(path), "--quiet", "--overwrite", *flags]) == 0
    return np.asarray(cv2.imread(str(path), cv2.IMREAD_UNCHANGED))


@pytest.mark.parametrize("layout", ["side", "wipe"])
def test_both_sides_have_a_small_label_and_the_rest_is_as_without(
    clip: Path, tmp_path: Path, layout: str
) -> None:
    flags = ("--as", "compare", "--layout", layout)
    plain = still(clip, tmp_path / "a.png", *flags, "--no-labels")
    changed = (still(clip, tmp_path / "b.png", *flags) != plain).any(axis=2)
    half = changed.shape[1] // 2
    for side in (changed[:, :half], changed[:, half:]):
        assert 0.001 < side.mean() < 0.06, "a label is missing, or large"
        assert not side[: side.shape[0] * 4 // 5].any(), "labels stand at the bottom"


def test_labels_of_hdr_comparisons_are_as_bright_as_sdr_white(clip: Path, tmp_path: Path) -> None:
    flags = ("--as", "compare", "--in-hdr")
    plain = still(clip, tmp_path / "a.png", *flags, "--no-labels")
    told = still(clip, tmp_path / "b.png", *flags)
    changed = (told != plain).any(axis=2)
    assert changed.any()
    assert told[changed].max() / 65535 == pytest.approx(0.5807, abs=0.02), "PQ of 203 nits"


def test_a_label_is_read_at_any_size() -> None:
    dark = np.zeros((270, 480, 3), np.float32)
    shown = labelled(dark, ["SDR source", "SDR"])
    mask = text_mask("SDR source", 9)
    assert shown.max() > 0.9
    assert shown[..., 0].sum() == pytest.approx(mask.sum(), rel=1e-5), "not the whole text"
    assert not dark.any(), "the picture itself was written on"
    narrow = np.zeros((40, 30, 3), np.float32)
    short = labelled(narrow, ["SDR source", "SDR"])
    assert short[..., 0].sum() == pytest.approx(text_mask("SDR", 9).sum(), rel=1e-5)
    for shape in ((2, 2), (1, 300), (300, 1), (12, 12)):
        labelled(np.zeros((*shape, 3), np.float32), ["SDR source", "SDR"])


def test_exposure_is_stops_of_light_on_both_sides(clip: Path, tmp_path: Path) -> None:
    """What was not mapped before is darker by two stops of BT.1886, 2 ** (-2 / 2.4)."""
    flags = ("--as", "compare", "--no-labels", "--tone-map", "clip")
    plain = still(clip, tmp_path / "a.png", *flags).astype(float)
    down = still(clip, tmp_path / "b.png", *flags, "--exposure", "-2").astype(float)
    safe = plain.max(axis=2) < 250  # where a channel was not clipped, and with it the others
    error = np.abs(down[safe] - plain[safe] * 2 ** (-2 / 2.4))
    assert error.max() <= 1.5, "not two stops, but for rounding"
    assert safe[:, :480].any()
    assert safe[:, 480:].any()


def test_exposed_down_to_the_peak_nothing_is_mapped() -> None:
    level = np.linspace(0.01, 0.99, 99).astype(np.float32)
    picture = np.dstack([level[None]] * 3)
    mapped = sdr.tone_mapped(picture, "bt2390", 1.0)
    np.testing.assert_allclose(mapped, sdr.encoded(picture), atol=2e-3)


@pytest.mark.parametrize("flags", [[], ["--as", "hlg"], ["--as", "false-colour"],
                                   ["--as", "compare", "--in-hdr"]])  # fmt: skip
def test_exposure_is_refused_where_nothing_is_mapped(
    clip: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], flags: list[str]
) -> None:
    assert main(["preview", str(clip), str(tmp_path / "a.mp4"), "--exposure", "1", *flags]) == 2
    assert "--exposure applies to" in capsys.readouterr().err


def test_the_bands_are_the_studios() -> None:
    script = VIEWER.read_text("utf-8")
    for name, value in (("STEPS", ROUND_NITS), ("BELOW", BELOW_WHITE), ("ABOVE", ABOVE_WHITE)):
        found = re.search(rf"const {name} = (\[.*\]);", script)
        assert found is not None
        assert json.loads(found[1]) == json.loads(json.dumps(value))


def test_false_colour_steps_at_round_nits() -> None:
    white, peak = 203.0, 1000 / 203.0
    steps = bands("nits", white, peak)
    lower = [round(band.lower * white, 6) for band in steps]
    assert lower == [0, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 203, 400, 600]
    assert [band.label for band in steps][-3:] == ["203 white", "400", "600"]
    nits = np.array([0, 99.9, 100.1, 202.9, 203.1, 999], np.float32)
    shown = false_colour(np.dstack([nits[None] / np.float32(white)] * 3), "nits", white, peak)[0]
    found = [int(np.abs(np.array([b.colour for b in steps]) - rgb).sum(axis=1).argmin())
             for rgb in shown]  # fmt: skip
    assert found == [0, 10, 11, 11, 12, 14]
    assert shown[3, 2] > shown[3, 0], "below white it is blue"
    assert shown[4, 0] > shown[4, 2], "from white on orange"


def test_bands_grow_lighter_and_the_legend_shows_each() -> None:
    for scale in ("stops", "nits"):
        steps = bands(scale, 100.0, 10.0)
        lower = [band.lower for band in steps]
        assert lower == sorted(set(lower))
        picture = false_colour(np.zeros((270, 960, 3), np.float32), scale, 100.0, 10.0)
        legend = picture[270:].reshape(-1, 3)
        for band in steps:
            assert (
                np.abs(legend - np.asarray(band.colour, np.float32)).sum(axis=1) < 1e-6
            ).any(), band
