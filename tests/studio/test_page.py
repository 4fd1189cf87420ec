"""The studio's page in a browser: one sees, tries, decides and renders, and the EXRs agree."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import driven
import numpy as np
import pytest
from clips import SHARED
from driven import Page

from itmo_video.cli.main import main
from itmo_video.output.exr import read_exr

WEIGHTS = (0.2126, 0.7152, 0.0722)
PLACES = ((0.1, 0.2), (0.5, 0.5), (0.8, 0.3), (0.9, 0.9))
REAL = SHARED / "data" / "clips" / "cvvdp_ferris-ref.mp4"


def check_probe(page: Page, exr: Path) -> None:
    channels = read_exr(exr).channels
    luminance = np.stack([channels[c].astype(np.float64) for c in "RGB"], -1) @ WEIGHTS
    for x, y in PLACES:
        column, row, nits = page.probe(x, y)
        assert nits == pytest.approx(203 * luminance[row, column], rel=0.03, abs=0.02), (x, y)


def test_the_tone_map_may_be_that_of_aces(browser: Any, address: str) -> None:
    page = Page(browser, address)
    page.settled()
    seen = [page.pixels()]
    for name in ("clip", "aces"):
        page.tab.select_option("#tone-map", name)
        page.settled(tone=name)
        seen.append(page.pixels())
    assert len(set(seen)) == 3
    assert page.told == []


def story(browser: Any, clip: Path, folder: Path) -> None:
    """From a clip to a rendered shot with its own peak."""
    with driven.studio(clip, folder) as address:
        page = Page(browser, address)
        tab = page.tab

        # See: scrub, split, drag the divider, exposure on both sides
        box = tab.query_selector("#timeline").bounding_box()
        tab.mouse.click(box["x"] + 0.6 * box["width"], box["y"] + 30)
        page.until(lambda: int(page.stage()["frame"]) > 20, "the time line does not scrub")
        page.settled()
        seen = [page.pixels()]
        page.press("d", compare="split")
        seen.append(page.pixels())
        handle = tab.query_selector("#divider").bounding_box()
        tab.mouse.move(handle["x"] + 1, handle["y"] + 20)
        tab.mouse.down()
        tab.mouse.move(handle["x"] - 200, handle["y"] + 20, steps=4)
        tab.mouse.up()
        page.until(
            lambda: int(tab.get_attribute("#divider", "aria-valuenow")) < 45, "it is not dragged"
        )
        page.settled()
        seen.append(page.pixels())
        for side, exposures in (("hdr", "0,-2"), ("sdr", "-2,-2")):
            tab.locator(f"#exposure-{side}").fill("-2")
            page.settled(exposures=exposures)
            seen.append(page.pixels())
        page.press("0", exposures="0,0")
        page.press("d", compare="hdr")

        # Try: a setting changed shows, and is what convert writes
        page.go(30)
        page.set("strength", 0.8)
        seen.append(page.pixels())
        assert len(set(seen)) == len(seen), "a control changed nothing"
        out = folder / "one"
        command = ["convert", str(clip), str(out), "--quiet"]
        assert main([*command, "--strength", "0.8", "--frames", "30"]) == 0
        check_probe(page, next(out.glob("*.exr")))

        # Decide: a shot split, given its own peak, saved
        shots = page.get("state")["document"]["shots"]
        page.edits(lambda: tab.click("#split-shot"))
        tab.click("#of-shot")
        tab.wait_for_selector("#of-shot[aria-pressed=true]")
        page.set("peak_nits", 2500)
        after = page.get("state")["document"]["shots"]
        assert len(after) == len(shots) + 1
        assert [s["first"] for s in after if s["own"]] == [30]
        page.opens("r", "files")
        preset, listed = page.saved("preset", "look"), page.saved("shots", "shots")
        told = tab.inner_text("#command")
        assert str(preset) in told
        assert str(listed) in told
        page.closes("files")
        out = folder / "two"
        command = ["convert", str(clip), str(out), "--quiet", "--preset", str(preset)]
        assert main([*command, "--analysis", str(listed), "--frames", "29-30"]) == 0
        check_probe(page, next(out.glob("*.0030.exr")))
        page.go(29)
        check_probe(page, next(out.glob("*.0029.exr")))

        # Render, and reload while it runs
        page.opens("r", "files")
        tab.fill("#render-name", "three")
        tab.click("#render-convert")
        page.until(lambda: tab.inner_text("#render-says") != "", "no progress")
        tab.reload()
        page.ready()
        page.opens("r", "files")
        page.until(lambda: "Done" in tab.inner_text("#render-says"), "it did not end")
        page.closes("files")
        assert page.get("state")["document"]["shots"] == after, "a reload lost what was decided"
        frames = page.get("about")["frames"]
        assert len(list((folder / "three").glob("*.exr"))) == frames
        page.go(30)
        check_probe(page, next((folder / "three").glob("*.0030.exr")))
        assert page.told == [], "the page complained, or asked for something elsewhere"


def test_from_clip_to_a_rendered_shot(browser: Any, tmp_path: Path) -> None:
    story(browser, driven.CLIP, tmp_path)


@pytest.mark.shared
def test_on_a_real_clip(browser: Any, tmp_path: Path) -> None:
    story(browser, REAL, tmp_path)


def test_all_views_and_keys(browser: Any, address: str) -> None:
    page = Page(browser, address)
    page.go(12)
    seen = {}
    views = ("picture", "false", "difference", "map", "gain")
    for key, view in zip("12345", views, strict=True):
        page.press(key, view=view)
        seen[key] = page.pixels()
    page.press("1", view="picture")
    for key, drawn in (("t", {"tone": "clip"}), ("c", {"mask": "true"})):
        page.press(key, **drawn)
        seen[key] = page.pixels()
    assert len(set(seen.values())) == len(seen), "a view shows what another shows"
    page.press("ArrowRight", frame="13")
    page.press("End", frame="48")
    starts = [shot["first"] for shot in page.get("state")["document"]["shots"]]
    page.press("ArrowUp", frame=str(starts[-1]))
    for key, dialog in (("v", "variants"), ("r", "files"), ("?", "help")):
        page.opens(key, dialog)
        page.closes(dialog)
    assert page.told == []


def test_a_and_b_undo_and_variants(browser: Any, address: str) -> None:
    page = Page(browser, address)
    tab = page.tab
    page.go(12)
    page.press("t", tone="clip")  # a tone map is one for all that is compared
    before = page.pixels()
    page.edits(lambda: tab.keyboard.press("Shift+B"))
    page.set("peak_nits", 4000)
    page.set("strength", 0.6)
    changed = page.pixels()
    assert changed != before
    page.press("b", compare="b")
    assert page.pixels() == before, "B is not what was kept"
    page.press("b", compare="hdr")
    for _ in range(2):
        page.edits(lambda: tab.keyboard.press("Control+z"))
    assert page.pixels() == before, "undo does not lead back"
    for _ in range(2):
        page.edits(lambda: tab.keyboard.press("Control+y"))
    assert page.pixels() == changed
    page.opens("v", "variants")
    presets = page.get("about")["presets"]
    sheet = tab.locator("#sheet button")
    page.until(lambda: sheet.count() == len(presets), "not all presets were tried")
    tab.click("#sheet button:has(b:text-is('paper'))")
    page.until(lambda: tab.input_value("#preset") == "paper", "the variant was not taken")
    page.settled()
    assert page.told == []


def test_a_key_at_once_after_a_dialog_is_not_lost(browser: Any, address: str) -> None:
    page = Page(browser, address)
    opened = page.tab.evaluate(
        """() => {
          document.getElementById('variants').showModal();
          document.getElementById('vary').focus();
          document.getElementById('variants').close();
          document.getElementById('vary').dispatchEvent(
            new KeyboardEvent('keydown', {key: 'r', bubbles: true, cancelable: true}));
          return document.getElementById('files').open;
        }"""
    )
    assert opened


def test_overtaken_requests_keep_no_connection(browser: Any, address: str) -> None:
    """A browser has six a host: what is not read to its end holds one until it is collected."""
    page = Page(browser, address)
    open_ones: set[Any] = set()
    page.tab.on("request", lambda request: open_ones.add(request))
    for ended in ("requestfinished", "requestfailed"):
        page.tab.on(ended, lambda request: open_ones.discard(request))
    for frame in range(20, 32):  # faster than they are rendered, in two lanes
        page.tab.evaluate(
            """(index) => Promise.all([import('./store.js'), import('./views.js')])
              .then(([{change}]) => { change({index, split: 'sdr'}, 'frame'); })""",
            frame,
        )
    page.settled(frame="32")
    page.until(lambda: not open_ones, "requests hold their connections")
    page.press("3", view="difference")
    page.press("s", compare="sdr")  # one picture in two roles
    page.press("ArrowRight", frame="33")
    page.until(lambda: not open_ones, "requests hold their connections")
    assert page.told == []


def test_two_pages_of_one_studio(browser: Any, address: str) -> None:
    one = Page(browser, address)
    two = Page(browser, address, beside=one)
    one.go(12)
    two.go(12)
    before = one.pixels()
    asked: list[str] = []
    one.tab.on("request", lambda request: asked.append(request.url))
    two.set("strength", 0.3)
    one.settled()
    assert one.pixels() == two.pixels() != before
    assert len([url for url in asked if "api/picture" in url]) < 12, "it asks and asks"
    for page in (one, two, one):  # neither keeps the other from its pictures
        for other in (one, two):
            for _ in range(6):
                other.tab.keyboard.press("ArrowRight")
        page.settled()
    assert one.told == two.told == []


def test_sdr_follows_its_settings(browser: Any, address: str) -> None:
    """Also where another page changed them, and where they are the shot's own."""
    page, other = Page(browser, address), Page(browser, address)
    page.go(12)
    page.press("s", compare="sdr")
    page.press("{", exposures="-0.5,0")  # else all above white is white
    seen = [page.pixels()]
    for values, shot in (({"range": "full"}, None), ({"over_white": "keep"}, 0)):
        other.edit(do="set", values=values, shot=shot)
        page.press("ArrowRight")  # to one that it has not yet: the answer is by newer settings
        page.go(12)
        seen.append(page.pixels())
        page.go(13)
    assert len(set(seen)) == 3, "an old picture is shown"
    assert page.told == other.told == []


@pytest.mark.parametrize("key", ["", "d"])
def test_it_plays_a_loop(browser: Any, address: str, key: str) -> None:
    page = Page(browser, address)
    tab = page.tab
    page.go(5)
    if key:
        page.press(key, compare="split")
    tab.keyboard.press("p")
    seen: set[str] = set()

    def moves() -> bool:
        seen.add(page.stage()["frame"])
        return len(seen) > 10

    page.until(moves, "it does not play")
    tab.keyboard.press(" ")
    tab.wait_for_selector("#play[aria-pressed=false]")
    page.settled()
    assert page.told == []


@pytest.mark.parametrize("width", [420, 1600, 2560])
def test_nothing_is_cut_off(browser: Any, address: str, width: int) -> None:
    page = Page(browser, address, width, 900)
    wide = page.tab.evaluate(
        "[...document.querySelectorAll('body, #stage, #side, .tools, .transport, .panel')]"
        ".map((e) => e.scrollWidth - e.clientWidth)"
    )
    assert max(wide) <= 0, "something has to be scrolled sideways"
    if width == 420:
        shown = page.tab.evaluate("document.getElementById('picture').clientWidth")
        assert shown > 0.95 * width, "the picture is smaller than the page allows"
    unnamed = page.tab.evaluate(
        """[...document.querySelectorAll('button, select, input, canvas')].filter((e) =>
          !(e.ariaLabel || e.title || e.textContent.trim() || e.labels?.length || e.ariaHidden
            || e.id === 'overlay')).map((e) => e.outerHTML)"""
    )
    assert unnamed == [], "controls without a name for screen readers"
