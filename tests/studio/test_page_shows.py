"""What the studio's page shows is of the frame and of the settings that it names; its dialogs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from browser import PATIENCE_S
from driven import Page

WEIGHTS = (0.2126, 0.7152, 0.0722)


def white_nits(page: Page) -> float:
    """SDR white as the probe reads it, from its nits and its linear light."""
    nits = page.probe(0.5, 0.5)[2]
    rgb = (page.tab.get_attribute("#probe", "data-rgb") or "").split(",")
    return nits / sum(w * float(c) for w, c in zip(WEIGHTS, rgb, strict=True))


def plays(page: Page, key: str) -> None:
    """Play by a key until another frame is shown, in a loop, which does not end by itself."""
    before = page.stage()["frame"]
    page.tab.keyboard.press(key)
    page.until(lambda: page.stage()["frame"] != before, "it does not play")


def test_what_is_read_is_of_the_picture_shown(browser: Any, address: str) -> None:
    page = Page(browser, address)
    tab = page.tab
    page.go(12)

    # B has a white of its own
    page.set("white_nits", 100)
    page.edits(lambda: tab.keyboard.press("Shift+B"))
    page.edits(lambda: tab.keyboard.press("Control+z"))
    assert white_nits(page) == pytest.approx(203, rel=1e-3)
    page.press("b", compare="b")
    assert white_nits(page) == pytest.approx(100, rel=1e-3)
    page.press("2", view="false")
    assert "100 white" in tab.inner_text("#legend")
    page.press("1", view="picture")
    page.press("b", compare="hdr")

    # Lights are of the frame shown, also after playing
    tab.keyboard.press("g")
    page.until(lambda: page.stage().get("lights") == "12", "the lights did not come")
    plays(page, "p")
    tab.keyboard.press(" ")
    page.settled()
    shown = page.stage()["frame"]
    page.until(lambda: page.stage().get("lights") == shown, "the lights are of another frame")

    # Variants are of one frame
    asked: set[int] = set()
    tab.on(
        "request",
        lambda r: asked.add(r.post_data_json["index"]) if "api/try" in r.url else None,
    )
    plays(page, " ")
    page.opens("v", "variants")
    tab.wait_for_selector("#sheet[aria-busy=false]", timeout=PATIENCE_S * 1e3)
    assert len(asked) == 1
    page.closes("variants")
    page.settled()
    assert asked == {int(page.stage()["frame"]) - 1}
    assert page.told == []


def test_a_still_is_of_what_is_shown(browser: Any, address: str) -> None:
    page = Page(browser, address)
    tab = page.tab
    page.go(12)
    still = cv2.imencode(".png", np.zeros((8, 8, 3), np.uint8))[1].tobytes()
    held: list[Any] = []
    ended: list[str] = []
    tab.on("requestfinished", lambda r: ended.append(r.url) if "still.avif" in r.url else None)
    tab.route("**/api/still.avif*", lambda route: held.append(route))
    tab.keyboard.press("h")
    page.until(lambda: len(held) == 1, "no still was asked for")
    page.press("ArrowRight", frame="13")
    held[0].fulfill(body=still, content_type="image/png")
    page.until(lambda: len(ended) == 1, "the still did not come")
    tab.keyboard.press("h")
    page.until(lambda: len(held) == 2, "a late still was shown over the newer frame")
    assert "index=12&" in held[1].request.url
    held[1].fulfill(body=still, content_type="image/png")
    tab.wait_for_selector("#still", state="visible", timeout=PATIENCE_S * 1e3)
    page.press("ArrowRight", frame="14")
    tab.wait_for_selector("#still", state="hidden")
    tab.keyboard.press("h")
    page.until(lambda: len(held) == 3, "no still was asked for")
    held[2].fulfill(status=422, json={"error": "clip.mp4: the file was removed"})
    tab.wait_for_selector("#status.error")
    assert "was removed" in tab.inner_text("#status")
    assert all("422" in line for line in page.told), page.told


def test_the_dialog_says_what_became_of_it(browser: Any, address: str, tmp_path: Path) -> None:
    page = Page(browser, address)
    tab = page.tab
    page.opens("r", "files")
    tab.fill("#preset-name", "a/b")
    tab.press("#preset-name", "Enter")
    tab.wait_for_selector("#save-says.error")
    tab.fill("#preset-name", "mine")
    assert tab.inner_text("#save-says") == "", "it speaks of the name before"
    tab.press("#preset-name", "Enter")
    page.until(lambda: "mine.toml" in tab.inner_text("#save-says"), "Enter does not save")
    assert (tmp_path / "mine.toml").exists()
    asked: list[Any] = []
    tab.on("request", lambda r: asked.append(r) if "api/render" in r.url else None)
    tab.fill("#render-name", "a/b")
    tab.check("#render-again")
    tab.click("#render-convert")
    tab.wait_for_selector("#render-says.error")
    assert "a/b" in tab.inner_text("#render-says")
    assert asked[0].post_data_json["again"] is True
    page.closes("files")
    page.opens("r", "files")
    assert tab.inner_text("#render-says") == ""
    assert all("422" in line for line in page.told), page.told
