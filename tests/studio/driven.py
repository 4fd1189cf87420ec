"""A studio that runs as a command, and a browser on its page: for tests and for the guide."""

from __future__ import annotations

import re
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from command import start

PATIENCE_S = 60.0


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
    """The studio's page in a tab: what it complained of or asked for elsewhere is in `told`."""

    def __init__(self, browser: Any, address: str, width: int = 1600, height: int = 950) -> None:
        self.tab = browser.new_page(viewport={"width": width, "height": height})
        self.told: list[str] = []
        base = address.rsplit("/", 2)[0]
        self.tab.on("console", lambda message: self.told.append(f"console: {message.text}"))
        self.tab.on("pageerror", lambda error: self.told.append(f"error: {error}"))
        self.tab.on("request", self._asked(base))
        self.tab.goto(address)
        self.ready()

    def _asked(self, base: str) -> Callable[[Any], None]:
        def asked(request: Any) -> None:
            if not request.url.startswith((base, "blob:", "data:")):
                self.told.append(f"request: {request.url}")

        return asked

    def ready(self) -> None:
        self.tab.wait_for_selector("body[data-ready]", timeout=PATIENCE_S * 1e3)
        self.until(lambda: self.tab.inner_text("#cuts-state") == "", "the cuts were not found")
        self.settled()

    def until(self, holds: Callable[[], bool], otherwise: str) -> None:
        """Wait until something holds. (The page forbids Playwright's own, which is by eval.)"""
        end = time.monotonic() + PATIENCE_S
        while not holds():
            assert time.monotonic() < end, f"{otherwise}: {self.tab.inner_text('#status')}"
            time.sleep(0.05)

    def stage(self) -> dict[str, str]:
        return dict(self.tab.evaluate("({...document.getElementById('stage').dataset})"))

    def settled(self) -> None:
        """Wait until the whole picture of the present frame by the present settings is shown."""

        def holds() -> bool:
            version = self.tab.evaluate("fetch('api/state').then((r) => r.json())")["version"]
            number = self.tab.input_value("#frame-number")
            stage = self.stage()
            return (stage.get("version"), stage.get("frame"), stage.get("scale")) == (
                str(version), number, "1",
            )  # fmt: skip

        self.until(holds, "the picture did not come")
        self.tab.wait_for_timeout(60)

    def pixels(self) -> str:
        return str(self.tab.evaluate("document.getElementById('picture').toDataURL()"))

    def set(self, name: str, value: object) -> None:
        """Type a setting's value."""
        field = self.tab.locator(f"[data-setting={name}] input:not([type=range])")
        field.fill(str(value))
        field.press("Enter")
        self.tab.wait_for_timeout(200)
        self.settled()

    def probe(self, x: float, y: float) -> tuple[int, int, float]:
        """Point at a place, 0 to 1 across and down: the pixel and its nits."""
        box = self.tab.query_selector("#overlay").bounding_box()
        self.tab.mouse.move(box["x"] + x * box["width"], box["y"] + y * box["height"])
        told = self.tab.query_selector("#probe")
        at = [int(told.get_attribute(f"data-{name}")) for name in "xy"]
        return at[0], at[1], float(told.get_attribute("data-nits"))

    def go(self, number: int) -> None:
        self.tab.fill("#frame-number", str(number))
        self.tab.press("#frame-number", "Enter")
        self.settled()
        self.tab.evaluate("document.activeElement.blur()")

    def saved(self, kind: str, name: str) -> Path:
        self.tab.fill(f"#{kind}-name", name)
        self.tab.click(f"#save-{kind}")
        self.until(lambda: f"{name}." in self.tab.inner_text("#status"), "it was not saved")
        found = re.search(r"Saved: (.*)", self.tab.inner_text("#status"))
        assert found, self.tab.inner_text("#status")
        return Path(found[1])
