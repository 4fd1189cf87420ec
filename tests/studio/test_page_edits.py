"""Edits on the studio's page: each for what it was made for, in order, and none lost."""

from __future__ import annotations

import tomllib
from functools import partial
from pathlib import Path
from typing import Any

from driven import Page


def own(page: Page) -> list[dict[str, Any]]:
    return [shot["own"] for shot in page.get("state")["document"]["shots"]]


def of_shot(page: Page, number: int) -> None:
    page.go(number)
    page.tab.click("#of-shot")
    page.tab.wait_for_selector("#of-shot[aria-pressed=true]")


def show_frame(page: Page, index: int) -> None:
    """As playing does."""
    page.tab.evaluate(
        "(index) => import('./store.js').then((m) => m.change({index}, 'frame'))", index
    )


def test_a_setting_is_of_the_shot_that_it_was_begun_for(browser: Any, address: str) -> None:
    page = Page(browser, address)
    tab = page.tab
    page.go(20)
    page.edits(lambda: tab.click("#split-shot"))
    of_shot(page, 10)
    first = tab.inner_text("#of-shot")

    # Typed, and left for another shot without Enter
    field = tab.locator("[data-setting=peak_nits] input[type=number]")
    field.click()
    field.fill("555")
    box = tab.query_selector("#timeline").bounding_box()
    page.edits(lambda: tab.mouse.click(box["x"] + 0.98 * box["width"], box["y"] + 30))
    assert own(page)[0] == {"peak_nits": 555}
    assert own(page)[-1] == {}
    assert tab.inner_text("#of-shot") != first, "the controls stay with the shot that was left"
    page.until(lambda: field.input_value() == "1000", "they show the other shot's value")

    # Dragged while the frame moves to another shot
    page.go(10)
    box = tab.locator("[data-setting=strength] input[type=range]").bounding_box()
    tab.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + box["height"] / 2)
    tab.mouse.down()
    show_frame(page, 45)
    assert tab.inner_text("#of-shot") == first
    tab.mouse.move(box["x"] + 0.3 * box["width"], box["y"] + box["height"] / 2, steps=3)
    page.edits(lambda: tab.mouse.up())
    page.until(lambda: tab.inner_text("#of-shot") != first, "it is held for ever")
    assert set(own(page)[0]) == {"peak_nits", "strength"}
    assert own(page)[-1] == {}

    # What is undone is seen in the slider that was dragged
    slider = tab.locator("[data-setting=strength] input[type=range]")
    page.go(10)
    dragged = slider.input_value()
    slider.focus()
    page.edits(lambda: tab.click("#undo"))
    page.until(lambda: slider.input_value() != dragged, "the slider stays behind")
    assert page.told == []


def test_keys_in_fields(browser: Any, address: str, tmp_path: Path) -> None:
    page = Page(browser, address)
    tab = page.tab
    page.set("strength", 0.7)
    before = page.get("state")["version"]

    # The browser's own keys of editing stay the browser's
    tab.focus("#frame-number")
    for key in ("Control+Backspace", "Control+z", "Control+y", "Control+Shift+Z"):
        tab.keyboard.press(key)
    field = tab.locator("[data-setting=peak_nits] input[type=number]")
    field.focus()
    tab.keyboard.press("Control+z")

    # What is typed is saved
    field.fill("777")
    tab.keyboard.press("Control+s")
    page.until(lambda: (tmp_path / "cut_and_flash.json").exists(), "it is not saved")
    saved = tomllib.loads((tmp_path / "cut_and_flash.toml").read_text())
    assert saved["settings"]["peak-nits"] == 777
    assert page.get("state")["version"] == before + 1, "a key in a field was a command"
    changed = page.get("state")["document"]["changed"]
    assert changed == {"strength": 0.7, "peak_nits": 777}

    # Nothing is saved without what was typed, if that is refused, by the page or by the studio
    saves: list[str] = []
    tab.on("request", lambda r: saves.append(r.url) if "api/save" in r.url else None)

    def is_told(why: str) -> bool:
        return why in tab.inner_text("#status")

    for value, why in (("5000000", "1000000"), ("150", "below")):
        field.fill(value)
        tab.keyboard.press("Control+s")
        tab.wait_for_selector("#status.error")
        page.until(partial(is_told, why), "it is not told")
    field.fill("800")
    tab.keyboard.press("Control+s")
    page.until(lambda: ".json" in tab.inner_text("#status"), "it is not saved")
    assert len(saves) == 2
    assert "peak-nits = 800" in (tmp_path / "cut_and_flash.toml").read_text()

    # A frame that does not exist is refused, and the page goes on
    page.go(12)
    tab.fill("#frame-number", "2.5")
    tab.press("#frame-number", "Enter")
    tab.wait_for_selector("#status.error")
    assert "2.5" in tab.inner_text("#status")
    assert tab.input_value("#frame-number") == "12"
    page.press("ArrowRight", frame="13")

    # Caps Lock turns letters round
    for key, shift, drawn in (("D", False, "split"), ("D", False, "hdr"), ("b", True, "hdr")):
        tab.evaluate(
            "([key, shiftKey]) => document.body.dispatchEvent(new KeyboardEvent('keydown',"
            "{key, shiftKey, bubbles: true, cancelable: true}))",
            [key, shift],
        )
        page.settled(compare=drawn)
    page.until(lambda: page.get("state")["other"] is not None, "Shift+B is not found")
    assert all("422" in line for line in page.told), page.told


def test_no_edit_is_lost_on_a_slow_server(browser: Any, address: str) -> None:
    page = Page(browser, address)
    tab = page.tab
    operator = next(o for o in page.get("about")["operators"] if len(o["parameters"]) > 1)
    page.edit(do="set", values={"operator": operator["name"]})
    page.edit(do="split", at=20)
    tab.evaluate("import('./store.js').then((m) => m.refresh())")
    page.settled()
    of_shot(page, 10)
    held: list[Any] = []

    def first(route: Any) -> None:
        """The first edit is slow: it waits to be let go."""
        if held:
            route.continue_()
        else:
            held.append(route)

    tab.route("**/api/edit", first)

    def enter(setting: str, value: float, nth: int = 0) -> None:
        field = tab.locator(f"[data-setting={setting}] input[type=number]").nth(nth)
        field.evaluate(
            "(field, value) => { field.focus(); field.value = value;"
            "field.dispatchEvent(new Event('change')); field.blur(); }",
            value,
        )

    names = [p["name"] for p in operator["parameters"][:2]]
    values = [(p["lower"] + p["upper"]) / 2 for p in operator["parameters"][:2]]
    enter("strength", 0.4)
    page.until(lambda: len(held) == 1, "nothing was sent")
    enter("peak_nits", 500)
    for name, value in zip(names, values, strict=True):
        enter(name, value)
    show_frame(page, 45)
    enter("peak_nits", 600)
    held[0].continue_()
    page.until(lambda: own(page)[-1] == {"peak_nits": 600}, "an edit was lost")
    assert own(page)[0] == {
        "strength": 0.4,
        "peak_nits": 500,
        "operator_params": dict(zip(names, values, strict=True)),
    }
    page.settled()
    assert page.told == []


def test_an_edit_of_past_shots_is_refused(browser: Any, address: str) -> None:
    page = Page(browser, address)
    of_shot(page, 40)
    shots = len(own(page))
    page.edit(do="split", at=10)  # beside: this page does not know of it
    field = page.tab.locator("[data-setting=peak_nits] input[type=number]")
    field.fill("444")
    field.press("Enter")
    page.tab.wait_for_selector("#status.error")
    assert "shots have changed" in page.tab.inner_text("#status")
    assert own(page) == [{}] * (shots + 1)
    page.settled()
    page.set("peak_nits", 444)
    assert own(page) == [{}] * shots + [{"peak_nits": 444}]
    assert all("422" in line for line in page.told), page.told
