"""A studio that runs as a command, and a browser on its page: for tests and for the guide."""

from __future__ import annotations

import json
import re
import signal
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from browser import PATIENCE_S, until
from clips import SAMPLES
from command import start

CLIP = SAMPLES / "cut_and_flash.mp4"


@contextmanager
def studio(clip: Path, folder: Path, *more: str) -> Iterator[str]:
    """Start `itmo-video studio` and give its page's address; it must end well."""
    process = start("studio", clip, "--no-browser", "--folder", folder, *more)
    assert process.stdout is not None
    address = process.stdout.readline().strip()
    try:
        assert address.startswith("http://127.0.0.1:"), process.communicate(timeout=10)
        yield address
    finally:
        process.send_signal(signal.SIGINT)
        try:
            _, err = process.communicate(timeout=30)
        except subprocess.TimeoutExpired:
            process.kill()
            raise
    assert "Traceback" not in err, err
    assert process.returncode == 0, err


class Page:
    """The studio's page in a tab: what it complained of or asked for elsewhere is in `told`.

    Nothing here waits for a time: the stage says what is drawn, and that it is busy until it is.
    """

    def __init__(
        self, browser: Any, address: str, width: int = 1600, height: int = 950,
        beside: Page | None = None,
    ) -> None:  # fmt: skip
        """Open it; `beside` another page in the same browser, or in one of its own."""
        view = {"width": width, "height": height}
        self.context: Any = beside.context if beside else browser.new_context(viewport=view)
        self.tab = self.context.new_page()
        self.tab.set_default_timeout(PATIENCE_S * 1e3)
        self.told: list[str] = []
        base = address.rsplit("/", 2)[0]
        self.tab.on("console", lambda message: self.told.append(f"console: {message.text}"))
        self.tab.on("pageerror", lambda error: self.told.append(f"error: {error}"))
        self.tab.on("request", self._asked(base))
        self.tab.goto(address)
        self.size = self.get("about")["size"]
        self.ready()

    def _asked(self, base: str) -> Callable[[Any], None]:
        def asked(request: Any) -> None:
            if not request.url.startswith((base, "blob:", "data:")):
                self.told.append(f"request: {request.url}")

        return asked

    def get(self, what: str) -> dict[str, Any]:
        return dict(self.tab.evaluate(f"fetch('api/{what}').then((r) => r.json())"))

    def edit(self, **asked: Any) -> None:
        """Edit as a page does that is open beside: this one is not told."""
        post = "{method: 'POST', headers: {'content-type': 'application/json'}, body: asked}"
        status = self.tab.evaluate(
            f"(asked) => fetch('api/edit', {post}).then((r) => r.status)", json.dumps(asked)
        )
        assert status == 200

    def ready(self) -> None:
        self.tab.wait_for_selector("body[data-ready]", timeout=PATIENCE_S * 1e3)
        self.until(lambda: self.get("state")["is_analysed"], "the cuts were not found")
        self.until(lambda: self.tab.inner_text("#cuts-state") == "", "the cuts are not shown")
        self.settled()

    def until(self, holds: Callable[[], bool], otherwise: str) -> None:
        def asked() -> bool:
            self.tab.evaluate("1")  # events of the page are delivered only while it is asked
            return holds()

        until(asked, lambda: f"{otherwise}: {self.tab.inner_text('#status')} {self.stage()}")

    def stage(self) -> dict[str, str]:
        """What the stage says is drawn, and whether it is busy."""
        return dict(
            self.tab.evaluate(
                "(({dataset, ariaBusy}) => ({...dataset, busy: ariaBusy}))"
                "(document.getElementById('stage'))"
            )
        )

    def settled(self, **drawn: str) -> None:
        """Wait until the whole picture of the present frame by the present settings is drawn.

        With `drawn`: until the stage says that it is drawn so.
        """

        if len(self.context.pages) > 1:
            self.tab.bring_to_front()  # a browser does not draw what is hidden

        def holds() -> bool:
            want = {
                "version": str(self.get("state")["version"]), "busy": "false", "scale": "1",
                "frame": self.tab.input_value("#frame-number"), **drawn,
            }  # fmt: skip
            return want.items() <= self.stage().items()

        self.until(holds, f"the picture did not come {drawn}")

    def press(self, key: str, **drawn: str) -> None:
        """Press a key that changes how the picture is looked at: `drawn` says how."""
        self.tab.keyboard.press(key)
        self.settled(**drawn)

    def edits(self, act: Callable[[], object]) -> dict[str, Any]:
        """Do something that changes the document, once; the state then."""
        before = self.get("state")["version"]
        act()
        self.until(lambda: self.get("state")["version"] > before, "nothing was changed")
        self.settled()
        return self.get("state")

    def opens(self, key: str, dialog: str) -> None:
        self.tab.keyboard.press(key)
        self.tab.wait_for_selector(f"#{dialog}", state="visible", timeout=PATIENCE_S * 1e3)

    def closes(self, dialog: str) -> None:
        self.tab.keyboard.press("Escape")
        self.tab.wait_for_selector(f"#{dialog}", state="hidden", timeout=PATIENCE_S * 1e3)

    def pixels(self) -> str:
        return str(self.tab.evaluate("document.getElementById('picture').toDataURL()"))

    def set(self, name: str, value: object) -> None:
        """Type a setting's value, which is another one than before."""
        field = self.tab.locator(f"[data-setting={name}] input:not([type=range])")

        def enter() -> None:
            field.fill(str(value))
            field.press("Enter")

        self.edits(enter)

    def probe(self, x: float, y: float) -> tuple[int, int, float]:
        """Point at a place, 0 to 1 across and down: the pixel and its nits."""
        box = self.tab.query_selector("#overlay").bounding_box()
        self.tab.mouse.move(box["x"] + x * box["width"], box["y"] + y * box["height"])
        told = self.tab.query_selector("#probe")

        def at() -> list[int]:
            return [int(told.get_attribute(f"data-{name}") or -99) for name in "xy"]

        near = [2 + side / 200 for side in self.size]  # of a box that is smaller than the picture
        self.until(
            lambda: all(
                abs(pixel - part * side) < allowed
                for pixel, part, side, allowed in zip(at(), (x, y), self.size, near, strict=True)
            ),
            "the probe does not follow",
        )
        column, row = at()
        return column, row, float(told.get_attribute("data-nits"))

    def go(self, number: int) -> None:
        self.tab.fill("#frame-number", str(number))
        self.tab.press("#frame-number", "Enter")
        self.settled(frame=str(number))
        self.tab.evaluate("document.activeElement.blur()")

    def saved(self, kind: str, name: str) -> Path:
        self.tab.fill(f"#{kind}-name", name)
        self.tab.click(f"#save-{kind}")
        self.until(lambda: f"{name}." in self.tab.inner_text("#save-says"), "it was not saved")
        found = re.search(r"Saved: (.*)", self.tab.inner_text("#save-says"))
        assert found, self.tab.inner_text("#save-says")
        return Path(found[1])
