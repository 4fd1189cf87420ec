"""Makes the picture of the report in docs/guide/convert.md: the page about a sample clip.

python docs/guide/make_report_picture.py
Needs the extra `test` and Chromium.
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from itmo_video import ReportOptions, convert, make_settings, report

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests"))

from browser import chromium, until  # noqa: E402 - of the tests, found by the line above

CLIP = ROOT / "sample_clips" / "night_street.mp4"
PICTURE = ROOT / "docs" / "images" / "report.jpg"


def main() -> None:
    """Convert, report, and take a picture of the page's viewer."""
    with TemporaryDirectory() as name, chromium() as browser:
        folder = Path(name) / "out"
        convert(CLIP, folder, make_settings("default", layers=("expand_map", "gain")))
        page = report(folder, ReportOptions(clip=CLIP))
        tab = browser.new_page(viewport={"width": 1280, "height": 1180})
        tab.goto(page.as_uri())
        drawn = tab.locator("#screen")
        until(lambda: drawn.get_attribute("data-frame") is not None, "no frame is drawn")
        for exposure in ("#exposure", "#exposure-sdr"):
            tab.fill(exposure, "-3")  # down to where SDR's lamps are grey
        box = drawn.bounding_box()
        assert box is not None
        tab.mouse.move(box["x"] + 0.66 * box["width"], box["y"] + 0.17 * box["height"])
        until(lambda: "nits" in tab.inner_text("#read-out"), "no read-out")
        tab.screenshot(path=str(PICTURE), type="jpeg", quality=82)


if __name__ == "__main__":
    main()
