"""The report's page: its text, its figures, and how it behaves in a browser."""

from __future__ import annotations

import json
import re
import shutil
import sys
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from itmo_video import analyse, make_settings
from itmo_video.cli.main import main
from itmo_video.conversion.convert import convert
from itmo_video.conversion.run_options import RunOptions
from itmo_video.html_report import embed, page, plots
from itmo_video.output.exr import read_exr
from itmo_video.output.manifest import MANIFEST_NAME


def text_of(folder: Path) -> str:
    return (folder / page.REPORT_NAME).read_text("utf-8")


def light_of(codes: npt.NDArray[np.uint16], top: int) -> npt.NDArray[np.float64]:
    """The light that the viewer decodes from codes."""
    share = (codes - 1.0) / (embed.CODES - 1)
    return np.where(codes == 0, 0, 2 ** (share * (top - embed.LOWEST_STOP) + embed.LOWEST_STOP))


def test_codes_are_within_a_half_percent() -> None:
    light = np.geomspace(2.0**-11.9, 60, 5000).astype(np.float32)
    top = embed.highest_stop(60)
    back = light_of(embed.codes_of(light, top), top)
    assert np.abs(back / light - 1).max() < 0.005, "read-outs would be off"
    assert light_of(embed.codes_of(np.zeros(1, np.float32), top), top)[0] == 0, "black"


def test_page_is_whole_and_asks_for_nothing(folder: Path) -> None:
    text = text_of(folder)
    assert len(text.encode()) < 15e6
    for word in ("http:", "https:", "//cdn", "url(", "@import", "<link", "src="):
        assert word not in text, f"{word} could leave the page"
    for section in ("Viewer", "Light levels", "Over time", "Histogram", "Settings and assumptions"):
        assert section in text, f"{section} is missing"
    assert "Expand Map coverage" in text
    assert "Gain flicker" in text


def test_a_hostile_name_stays_text(folder: Path) -> None:
    text = text_of(folder)
    assert "<script>alert" not in text, "the file's name runs"
    assert "&lt;script&gt;alert(1)" in text


def test_a_hostile_manifest_stays_text(folder: Path, tmp_path: Path) -> None:
    """A manifest can hold what no file system takes: real slashes, and settings of any text."""
    copy = tmp_path / "copy"
    shutil.copytree(folder, copy)
    manifest = json.loads((copy / MANIFEST_NAME).read_text())
    manifest["source_name"] = "</script><script>alert(1)</script>.mp4"
    (copy / MANIFEST_NAME).write_text(json.dumps(manifest))
    text = page.report(copy).read_text("utf-8")
    assert "<script>alert" not in text, "the name runs"
    assert text.count("</script>") == 3, "the name ends a script"
    assert "&lt;/script&gt;&lt;script&gt;alert(1)" in text


def test_figures_are_the_exrs(folder: Path) -> None:
    largest, average = 0.0, 0.0
    matrix = np.array(
        [[0.6274, 0.3293, 0.0433], [0.0691, 0.9195, 0.0114], [0.0164, 0.0880, 0.8956]]
    )
    for path in folder.glob("*.exr"):
        channels = read_exr(path).channels
        rgb = np.stack([channels[c].astype(np.float64) for c in "RGB"])
        top = np.maximum(np.einsum("ij,jhw->ihw", matrix, rgb), 0).max(axis=0) * 203
        largest, average = max(largest, top.max()), max(average, top.mean())
    told = dict(re.findall(r"<dt>(\w+)</dt><dd>([\d.]+) nits", text_of(folder)))
    assert float(told["MaxCLL"]) == pytest.approx(largest, rel=0.01)
    assert float(told["MaxFALL"]) == pytest.approx(average, rel=0.01)
    assert re.search(r"<dt>Cuts</dt><dd>1</dd>", text_of(folder)), "the cut at 7 is not marked"


def test_each_shot_s_rendering_is_told_as_analyse_tells_it(folder: Path, clip: Path) -> None:
    rows = re.findall(r">rendering, frames ([\d-]+)</th><td>([^<]*)</td>", text_of(folder))
    told = [
        (f"{shot.first}-{shot.last}", str(shot.rendering).replace("'", "&#39;"))
        for shot in analyse(clip).shots
    ]
    assert rows == told
    assert len(rows) == 2


def test_report_without_source_says_what_is_missing(folder: Path, tmp_path: Path) -> None:
    output = tmp_path / "page.html"
    assert main(["report", str(folder), "--output", str(output), "--quiet"]) == 0
    text = output.read_text("utf-8")
    assert "The source was not given" in text
    assert 'id="split"' not in text, "there is nothing to compare with"


def test_missing_template_engine_is_told(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "jinja2", None)
    assert main(["report", str(folder), "--quiet"]) == 2
    assert "pip install '.[report]'" in capsys.readouterr().err


def test_too_many_pictures_are_thinned_evenly() -> None:
    shown = [embed.Embedded(n, n, (1, 1), "x" * 100, None, None) for n in range(10)]
    assert [e.number for e in page.thinned(shown, 500)] == [0, 2, 4, 7, 9]
    assert len(page.thinned(shown, 1)) == 1


@pytest.mark.parametrize("largest", [0.00634, 0.01, 1.0, 2.79, 3.0, 100.0, 451.1])
def test_ticks_are_round_and_reach_the_top(largest: float) -> None:
    ticks = plots.even_ticks(largest)
    assert ticks[0] == 0
    assert ticks[-1] >= largest * (1 - 1e-9) > ticks[-2]
    assert 2 <= len(ticks) <= 5
    assert all(float(f"{t:.2g}") == pytest.approx(t) for t in ticks), "not round"


def test_plots_stay_in_their_box() -> None:
    line = plots.Line("x", [0.0, 5000.0, float("nan"), 1.0])
    drawn = plots.draw(plots.Plot("t", "u", [line], [1, 2, 3, 4], is_log=True))
    assert all(plots.TOP <= y <= plots.HEIGHT - plots.BOTTOM for y, _ in drawn.y_ticks)


def test_convert_without_frames_makes_no_report(clip: Path, tmp_path: Path) -> None:
    command = ["convert", str(clip), str(tmp_path / "o"), "--null", "--report", "--quiet"]
    assert main(command) == 2


def test_a_gap_is_told(clip: Path, tmp_path: Path) -> None:
    convert(clip, tmp_path / "o", make_settings(), RunOptions(frames="1-3,6-7"))
    text = page.report(tmp_path / "o").read_text("utf-8")
    assert "Frames 4-5,8" in text
    assert "are not in the folder" in text
