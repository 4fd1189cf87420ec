"""The report in a browser: its controls, its read-out, its keyboard."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from browser import PATIENCE_S, until

from itmo_video import make_settings
from itmo_video.delivery.aces import aces_sdr
from itmo_video.delivery.preview import preview
from itmo_video.delivery.preview_options import PreviewOptions
from itmo_video.html_report import page
from itmo_video.output.exr import read_exr

WEIGHTS = (0.2126, 0.7152, 0.0722)


@pytest.fixture
def opened(browser: Any, folder: Path) -> Iterator[tuple[Any, list[str]]]:
    told: list[str] = []
    tab = browser.new_page(viewport={"width": 1200, "height": 900})
    tab.on("console", lambda message: told.append(f"console: {message.text}"))
    tab.on("pageerror", lambda error: told.append(f"error: {error}"))

    def refuse(dialog: Any) -> None:
        told.append("dialog")
        dialog.dismiss()

    def note(request: Any) -> None:
        if not request.url.startswith(("file:", "data:")):
            told.append(request.url)

    tab.on("dialog", refuse)
    tab.on("request", note)
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
    luminance = np.stack([channels[c].astype(np.float64) for c in "RGB"], -1) @ WEIGHTS
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
