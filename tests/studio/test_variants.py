"""Contact sheets: what is tried, and what may be written."""

from __future__ import annotations

import re
from pathlib import Path

import cv2
import pytest
from clips import moving_scene, write_ffv1

from itmo_video.cli.main import main
from itmo_video.errors import UsageError
from itmo_video.look import make_look
from itmo_video.presets import make_settings, preset_names
from itmo_video.studio.variants import COUNT, variants, varied


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("studio") / "<b>&scene.mkv"
    return write_ffv1(path, moving_scene(6, width=96, height=64))


def test_all_that_can_be_varied_gives_sound_looks() -> None:
    for name in varied()[1:]:
        found = variants(name)
        assert len(found) >= 2, name
        base = {"operator": "banterle2006", "peak_nits": 4000.0}
        for variant in found:
            if "l_max" in variant.values:
                base.pop("peak_nits", None)
            make_look(make_settings("paper", **{**base, **variant.values}))


def test_values_are_the_users() -> None:
    found = variants("min-lights", ["2", "8"])
    assert [variant.values for variant in found] == [{"min_lights": 2}, {"min_lights": 8}]
    assert [v.values["expand_map"] for v in variants("expand-map", ["off"])] == [False]
    assert len(variants("radius")) == COUNT
    for by, values in (("radius", ["x"]), ("layers", []), ("nonsense", []), ("expand_map", ["1"])):
        with pytest.raises(UsageError):
            variants(by, values)


def test_the_current_value_is_among_them_and_marked() -> None:
    for name, value in (("strength", 1.0), ("peak-nits", 777.0), ("radius", 16.0), ("hue", "keep")):
        setting = name.replace("-", "_")
        found = variants(name, current=make_settings("default", **{setting: value}))
        assert len(found) == len(variants(name))
        assert [v.values[setting] for v in found if v.is_current] == [value]
        assert [v.label.endswith("(current)") for v in found] == [v.is_current for v in found]
    asked = variants("strength", ["0.5", "2"], make_settings("default"))
    assert [v.values["strength"] for v in asked] == [0.5, 2], "who names values gets those"


def test_a_sheet_of_presets(clip: Path, tmp_path: Path) -> None:
    assert main(["variants", str(clip), str(tmp_path / "presets.html")]) == 0
    assert (tmp_path / "presets.html").read_text().count("<figure>") == len(preset_names())
    values = ["--preset", "paper", "--vary", "strength", "--values", "0,1"]
    assert main(["variants", str(clip), str(tmp_path / "a.png"), *values]) == 0
    sheet = cv2.imread(str(tmp_path / "a.png"))
    assert sheet is not None
    cells = [sheet[12:76, 12 + i * 108 : 108 + i * 108] for i in range(2)]
    assert (cells[0] != cells[1]).any(), "two strengths look the same"
    assert main(["variants", str(clip), str(tmp_path / "a.html"), *values[:3], "peak-nits"]) == 0
    text = (tmp_path / "a.html").read_text()
    assert text.count("<figure>") == COUNT
    assert len(re.findall(r"peak \d+ nits, mean [\d.]+", text)) == COUNT
    assert "<b>&scene" not in text, "a file's name is markup"
    assert len(preset_names()) >= 3


def test_variants_that_look_alike_are_said(
    clip: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flags = ["--preset", "paper", "--values", "0,1", "--vary"]
    for vary, is_told in (("lamps", True), ("strength", False)):
        assert main(["variants", str(clip), str(tmp_path / f"{vary}.png"), *flags, vary]) == 0
        told = f"{vary} makes no difference in frame 4: all look the same"
        assert (told in capsys.readouterr().err) == is_told


def test_nothing_of_others_is_written_over(clip: Path, tmp_path: Path) -> None:
    mine = tmp_path / "a.png"
    mine.write_text("mine")
    assert main(["variants", str(clip), str(mine), "--overwrite"]) == 5
    assert mine.read_text() == "mine"
    for more in (["--frame", "99"], ["--vary", "x"], ["--vary", "peak-nits", "--values", "1"]):
        assert main(["variants", str(clip), str(tmp_path / "b.png"), *more]) == 2, more
    assert main(["variants", str(clip), str(tmp_path / "b.tiff")]) == 2
