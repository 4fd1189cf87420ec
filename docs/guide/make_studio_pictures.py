"""Makes the pictures of docs/guide/studio.md: the studio on a sample clip, in three widths.

python docs/guide/make_studio_pictures.py
Needs the extra `test` and Chromium. The steps are those of the guide.
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests"))
sys.path.insert(0, str(ROOT / "tests" / "studio"))

from browser import chromium  # noqa: E402 - of the tests, found by the lines above
from driven import CLIP, Page, studio  # noqa: E402 - of the tests, too

IMAGES = ROOT / "docs" / "images"


def shot(page: Page, name: str) -> None:
    """Take a picture of the page."""
    page.settled()
    page.tab.screenshot(path=str(IMAGES / f"studio_{name}.jpg"), type="jpeg", quality=82)


def main() -> None:
    """Walk through the guide."""
    with TemporaryDirectory() as folder, chromium() as browser, studio(CLIP, Path(folder)) as at:
        page = Page(browser, at)
        tab = page.tab
        page.go(6)
        page.press("d", compare="split")
        page.probe(0.62, 0.4)
        shot(page, "1600")
        page.press("2", view="false")
        shot(page, "false_colour")
        page.press("1", view="picture")
        page.press("d", compare="hdr")
        page.press("ArrowDown")
        tab.keyboard.press("q")
        tab.wait_for_selector("#of-shot[aria-pressed=true]")
        page.set("peak_nits", 2500)
        shot(page, "shot")
        tab.keyboard.press("q")
        tab.wait_for_selector("#of-clip[aria-pressed=true]")
        page.opens("v", "variants")
        tab.wait_for_selector("#sheet[aria-busy=false]")
        shot(page, "variants")
        page.closes("variants")
        page.opens("r", "files")
        page.saved("preset", "look")
        page.saved("shots", "shots")
        shot(page, "save_and_render")
        page.closes("files")
        page.press("d", compare="split")
        for width, height in ((420, 900), (2560, 1400)):
            tab.set_viewport_size({"width": width, "height": height})
            shot(page, str(width))


if __name__ == "__main__":
    main()
