"""The report's page: its text, its figures, and how it behaves in a browser."""

from __future__ import annotations

import base64
import json
import re
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from browser import PATIENCE_S, until
from clips import moving_scene, write_ffv1

from itmo_video import analyse, make_settings
from itmo_video.cli.main import main
from itmo_video.conversion.convert import RunOptions, convert
from itmo_video.delivery.aces import aces_sdr
from itmo_video.delivery.preview import PreviewOptions, preview
from itmo_video.html_report import embed, page, plots
from itmo_video.output.exr import read_exr
from itmo_video.output.manifest import MANIFEST_NAME

HOSTILE = "<script>alert(1)<∕script>.mkv"  # file names cannot hold a plain slash
WEIGHTS = (0.2126, 0.7152, 0.0722)


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("clip")
    frames = moving_scene(12, width=160, height=96, cuts=(7,))
    return write_ffv1(folder / HOSTILE, [cv2.GaussianBlur(f, (0, 0), 1.5) for f in frames])


@pytest.fixture(scope="module")
def folder(clip: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Converted by the command line, with its report."""
    out = tmp_path_factory.mktemp("report") / "out"
    command = ["convert", str(clip), str(out), "--layers", "expand_map", "--report", "--quiet"]
    assert main(command) == 0
    return out


def text_of(folder: Path) -> str:
    return (folder / page.REPORT_NAME).read_text("utf-8")


def test_codes_are_within_a_half_percent() -> None:
    light = np.geomspace(2.0**-11.9, 60, 5000).astype(np.float32)
    top = embed.highest_stop(60)
    back = embed.light_of(embed.codes_of(light, top), top)
    assert np.abs(back / light - 1).max() < 0.005, "read-outs would be off"
    assert embed.light_of(embed.codes_of(np.zeros(1, np.float32), top), top)[0] == 0, "black"


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


@pytest.fixture
def opened(browser: Any, folder: Path) -> Iterator[tuple[Any, list[str]]]:
    told: list[str] = []
    tab = browser.new_page(viewport={"width": 1200, "height": 900})
    tab.on("console", lambda message: told.append(f"console: {message.text}"))
    tab.on("pageerror", lambda error: told.append(f"error: {error}"))
    tab.on("dialog", lambda dialog: told.append("dialog") or dialog.dismiss())
    tab.on("request", lambda r: r.url.startswith(("file:", "data:")) or told.append(r.url))
    tab.goto((folder / page.REPORT_NAME).as_uri())
    tab.wait_for_selector("#screen[data-frame]")
    yield tab, told
    tab.close()


def pixels(tab: Any) -> str:
    return str(tab.evaluate("document.getElementById('screen').toDataURL()"))


def move(tab: Any, control: str, value: float) -> None:
    tab.evaluate(
        "([id, v]) => { const e = document.getElementById(id); e.value = v;"
        " e.dispatchEvent(new Event('input')); }",
        [control, value],
    )
    tab.wait_for_selector("#screen[aria-busy=false]", timeout=PATIENCE_S * 1e3)


def changed(tab: Any, before: str) -> str:
    """The picture once it is another one."""
    until(lambda: pixels(tab) != before, "a control changed nothing")
    return pixels(tab)


def test_controls_change_the_picture(opened: tuple[Any, list[str]]) -> None:
    tab, told = opened
    seen = [pixels(tab)]
    for control, value in (("frame", 5), ("exposure", -2), ("exposure-sdr", -1), ("split", 10)):
        move(tab, control, value)
        seen.append(changed(tab, seen[-1]))
    for choice in ("input[value=false]", "#map"):
        tab.check(choice)
        seen.append(changed(tab, seen[-1]))
    assert len(set(seen)) == len(seen), "a control leads back to what was shown before"
    assert told == [], "the page complained or asked for something"


def test_it_plays_and_its_divider_is_dragged(opened: tuple[Any, list[str]]) -> None:
    tab, told = opened
    tab.click("#play")
    seen: set[str] = set()

    def plays() -> bool:
        seen.add(tab.get_attribute("#screen", "data-frame"))
        return len(seen) > 3

    until(plays, "it does not play")
    tab.click("#play")
    handle = tab.query_selector("#divider").bounding_box()
    tab.mouse.move(handle["x"] + 1, handle["y"] + 20)
    tab.mouse.down()
    tab.mouse.move(handle["x"] - 150, handle["y"] + 20, steps=3)
    tab.mouse.up()
    until(lambda: float(tab.input_value("#split")) < 45, "the divider does not follow")
    assert told == []


def test_aces_is_opencolorios(opened: tuple[Any, list[str]], folder: Path) -> None:
    pytest.importorskip("PyOpenColorIO", reason="opencolorio is not installed")
    tab, told = opened
    move(tab, "split", 0)
    before = pixels(tab)
    tab.select_option("#tone-map", "aces")
    data = base64.b64decode(changed(tab, before).partition(",")[2])
    seen = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    assert seen is not None
    number = int(tab.get_attribute("#screen", "data-frame"))
    channels = read_exr(next(folder.glob(f"*.{number:04d}.exr"))).channels
    truth = 255 * aces_sdr([channels[c] for c in "RGB"], "rec709")
    off = np.abs(seen[..., ::-1] - truth)
    assert off.mean() < 1
    assert np.percentile(off, 99.9) < 4
    assert told == []


def test_a_narrow_page_cuts_nothing_off(browser: Any, folder: Path) -> None:
    tab = browser.new_page(viewport={"width": 400, "height": 800})
    tab.goto((folder / page.REPORT_NAME).as_uri())
    tab.wait_for_selector("#screen[data-frame]")
    for selector in ("body", "figure"):
        wide = f"[...document.querySelectorAll('{selector}')].map(e => e.scrollWidth)"
        assert max(tab.evaluate(wide)) <= 400, f"{selector} has to be scrolled sideways"
    tab.close()


def test_keyboard_is_enough(opened: tuple[Any, list[str]]) -> None:
    tab, told = opened
    tab.focus("#frame")
    tab.keyboard.press("ArrowRight")
    tab.wait_for_selector("#screen[data-frame='2']", timeout=PATIENCE_S * 1e3)
    tab.focus("#screen")
    tab.keyboard.press("Shift+ArrowRight")
    until(lambda: "nits" in tab.inner_text("#read-out"), "no read-out by keyboard")
    assert told == []


def test_read_out_is_the_exrs_value(opened: tuple[Any, list[str]], folder: Path) -> None:
    tab, _ = opened
    move(tab, "frame", 4)
    number = int(tab.get_attribute("#screen", "data-frame"))
    data = json.loads(tab.inner_text("#data"))
    assert data["frames"][4]["number"] == number
    channels = read_exr(next(folder.glob(f"*.{number:04d}.exr"))).channels
    luminance = sum(w * channels[c].astype(np.float64) for c, w in zip("RGB", WEIGHTS, strict=True))
    tab.locator("#screen").scroll_into_view_if_needed()
    box = tab.query_selector("#screen").bounding_box()
    output = tab.query_selector("#read-out")
    seen = {output.text_content()}
    for part_x, part_y in ((0.1, 0.2), (0.5, 0.5), (0.83, 0.31), (0.9, 0.95)):
        tab.mouse.move(box["x"] + part_x * box["width"], box["y"] + part_y * box["height"])
        until(lambda: output.text_content() not in seen, f"it does not follow to {part_x}")
        seen.add(output.text_content())
        x, y = (int(output.get_attribute(f"data-{axis}")) for axis in "xy")
        nits = float(output.get_attribute("data-nits"))
        assert nits == pytest.approx(203 * luminance[y, x], rel=0.03), f"read-out at {x}, {y}"


def test_av1_hdr10_preview_plays(browser: Any, clip: Path, tmp_path: Path) -> None:
    preview(clip, tmp_path / "film.mp4", make_settings(), options=PreviewOptions())
    (tmp_path / "play.html").write_text("<video id=v muted src=film.mp4></video>")
    tab = browser.new_page()
    tab.goto((tmp_path / "play.html").as_uri())
    told = tab.evaluate(
        """() => new Promise((done) => {
          const v = document.getElementById('v');
          v.onended = () => done(v.getVideoPlaybackQuality().totalVideoFrames);
          v.onerror = () => done(v.error.message);
          v.play().catch((e) => done(String(e)));
        })"""
    )
    tab.close()
    assert isinstance(told, int), f"it does not play: {told}"
    assert told == 12, "frames were lost"


def test_convert_without_frames_makes_no_report(clip: Path, tmp_path: Path) -> None:
    command = ["convert", str(clip), str(tmp_path / "o"), "--null", "--report", "--quiet"]
    assert main(command) == 2


def test_a_gap_is_told(clip: Path, tmp_path: Path) -> None:
    convert(clip, tmp_path / "o", make_settings(), RunOptions(frames="1-3,6-7"))
    text = page.report(tmp_path / "o").read_text("utf-8")
    assert "Frames 4-5,8" in text
    assert "are not in the folder" in text
