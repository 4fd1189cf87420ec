"""The site of docs/: built strictly, whole in itself, and what people search for is found."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import time
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import cv2
import pytest
from browser import chromium, until
from clips import REPOSITORY, moving_scene, write_ffv1

from itmo_video.cli.main import _parser, main
from itmo_video.cli.parser_facts import commands_of
from itmo_video.output.exr import read_exr
from itmo_video.output.exr_attributes import ATTRIBUTES, LAYER_CHANNELS
from itmo_video.settings import LAYERS

MOST_PICTURE_BYTES = 400_000
SEARCHED = {  # what people type, and a page that must be among those found
    "resume": "guide/convert.html",
    "interrupt": "guide/convert.html",
    "batch": "guide/farm.html",
    "HDR10": "guide/hdr_masters.html",
    "Nuke": "guide/nuke_resolve_blender.html",
    "ProRes": "guide/hdr_masters.html",
    "flicker": "flicker.html",
    "Resolve": "guide/nuke_resolve_blender.html",
    "Ultra HDR": "guide/gain_map_stills.html",
    "ffmpeg": "guide/pipes.html",
    "NumPy": "guide/python.html",
    "interlaced": "guide/troubleshooting.html",
    "--peak-nits": "reference/command_line.html",
    "whiteLuminance": "reference/exr_attributes.html",
}


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("site")
    script = REPOSITORY / "docs/site/build.py"
    done = subprocess.run(
        [sys.executable, script, target], capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return target / "site"


class _Page(HTMLParser):
    """Names of a page's anchors, what it links to and what it loads."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.without_alt: list[str] = []
        self.steps = 0  # items of numbered lists
        self._lists: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        if tag in ("ol", "ul"):
            self._lists.append(tag)
        self.steps += tag == "li" and self._lists[-1:] == ["ol"]
        self.anchors |= {given[name] for name in ("id", "name") if name in given}
        if tag == "a" and "href" in given:
            self.links.append(given["href"])
        elif tag == "link" and "href" in given:
            self.loaded.append(given["href"])
        elif tag in ("img", "script", "iframe", "source", "video") and "src" in given:
            self.loaded.append(given["src"])
        if tag == "img" and not given.get("alt"):
            self.without_alt.append(given.get("src", ""))

    def handle_endtag(self, tag: str) -> None:
        if tag in ("ol", "ul") and self._lists:
            self._lists.pop()


def test_every_link_and_picture_is_there_and_nothing_comes_from_a_network(site: Path) -> None:
    pages = {path: _Page(path.read_text("utf-8")) for path in site.rglob("*.html")}
    assert len(pages) > 25
    wrong = []
    for path, page in pages.items():
        if path.name == "404.html":  # its links are absolute
            continue
        wrong += [f"{path.name}: {src} has no alt text" for src in page.without_alt]
        for link in page.links + page.loaded:
            url = urlsplit(link)
            if url.scheme or url.netloc:
                if link in page.loaded:
                    wrong.append(f"{path.name} loads {link}")
                continue
            target = (path.parent / unquote(url.path)).resolve() if url.path else path
            if not target.exists():
                wrong.append(f"{path.name}: {link}")
            elif url.fragment and target in pages and url.fragment not in pages[target].anchors:
                wrong.append(f"{path.name}: no anchor {link}")
    assert not wrong


def test_numbered_steps_and_code_are_what_they_were_meant_as(site: Path) -> None:
    """An indent that is a list's on other hosts may not be one here."""
    steps = 0
    for source in (site.parent / "docs").rglob("*.md"):
        text = source.read_text("utf-8")
        html = site / source.relative_to(site.parent / "docs").with_suffix(".html")
        built = html.read_text("utf-8")
        meant = len(re.findall(r"^\d+\. ", re.sub(r"```.*?```", "", text, flags=re.DOTALL), re.M))
        assert _Page(built).steps == meant, source.name
        assert "```" not in re.sub(r"<[^>]*>", "", built), source.name
        steps += meant
    assert steps >= 10


def test_what_people_search_for_is_found(site: Path) -> None:
    entries = json.loads((site / "search.json").read_text("utf-8"))["items"]
    for term, page in SEARCHED.items():
        found = {
            entry["location"].split("#")[0]
            for entry in entries
            if term.lower() in f"{entry['title']} {entry['text']}".lower()
        }
        assert page in found, (term, sorted(found))


def test_search_works_from_the_disk_and_no_page_is_wider_than_a_phone(site: Path) -> None:
    with chromium() as browser:
        context = browser.new_context(viewport={"width": 1600, "height": 1000}, offline=True)
        tab = context.new_page()
        asked: list[str] = []
        tab.on("request", lambda request: asked.append(request.url))
        tab.goto((site / "index.html").as_uri())
        results = tab.locator('a[href*="h=resume"]')

        def is_found() -> bool:
            """Type until results come: keys are lost before the page's worker has its index."""
            for key in ("Escape", "/", "Control+a"):
                tab.keyboard.press(key)
            tab.keyboard.type("resume", delay=20)
            end = time.monotonic() + 5
            while time.monotonic() < end:
                if results.count() and "convert.html" in results.first.get_attribute("href"):
                    return True
                tab.wait_for_timeout(50)
            return False

        until(is_found, lambda: f"found: {[link.text_content() for link in results.all()]}")
        tab.keyboard.press("Enter")
        tab.wait_for_url(re.compile("convert.html"), wait_until="commit", timeout=60_000)
        tab.set_viewport_size({"width": 420, "height": 900})
        for name in ("index", "guide/convert", "reference/settings", "quality"):
            tab.goto((site / f"{name}.html").as_uri())
            width = tab.evaluate("document.documentElement.scrollWidth")
            assert width <= 420, (name, width)
            cut = tab.locator(".language-sh code").evaluate_all(
                "all => all.filter(e => e.scrollWidth > e.clientWidth).map(e => e.textContent)"
            )
            assert not cut, f"{name}: commands are cut off: {cut}"
        assert not [url for url in asked if not url.startswith(("file:", "data:", "blob:"))]


def test_links_in_the_repository_lead_somewhere() -> None:
    for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "sample_clips/README.md"):
        path = REPOSITORY / name
        for link in re.findall(r"\]\(([^)\s]+)\)", path.read_text("utf-8")):
            if not urlsplit(link).scheme:
                assert (path.parent / urlsplit(link).path).exists(), f"{name}: {link}"


def test_files_named_in_the_docs_exist() -> None:
    rooms = "|".join(p.name for p in (REPOSITORY / "itmo_video").iterdir() if p.is_dir())
    named = re.compile(
        rf"(?<![\w/.])(?:tests|docs|itmo_video|configs|sample_clips|{rooms})/[\w./-]+"
        r"\.(?:py|c|h|md|toml|yaml|sh|ipynb)\b"
    )
    pages = [REPOSITORY / "README.md", REPOSITORY / "CONTRIBUTING.md"]
    pages += (REPOSITORY / "docs").rglob("*.md")
    found = {(page.name, path) for page in pages for path in named.findall(page.read_text("utf-8"))}
    assert len(found) > 30
    roots = (REPOSITORY, REPOSITORY / "itmo_video", REPOSITORY / "docs")
    assert not [at for at in found if not any((root / at[1]).exists() for root in roots)]


def test_pictures_are_small_enough_to_load() -> None:
    pictures = [
        path
        for kind in ("png", "jpg", "webp", "svg")
        for path in (REPOSITORY / "docs").rglob(f"*.{kind}")
    ]
    assert len(pictures) > 10
    for path in pictures:
        assert path.stat().st_size <= MOST_PICTURE_BYTES, path
        picture = cv2.imread(str(path))
        assert picture is not None, path
        assert picture.shape[1] <= 2560, path


def test_the_reference_has_all_commands_flags_and_no_empty_row(site: Path) -> None:
    page = (site.parent / "docs/reference/command_line.md").read_text("utf-8")
    for command in commands_of(_parser()):
        assert f"\n## {command.name}\n" in page
        for flag in command.flags:
            assert f"`{flag.names[0]}`" in page
            assert flag.help, (command.name, flag.names)
    for path in (site.parent / "docs/reference").glob("*.md"):
        assert path.read_text("utf-8").count("\n") > 10, path
    for path in (site / "reference").glob("*.html"):
        assert "\\|" not in path.read_text("utf-8"), path


def test_the_reference_in_the_repository_is_current() -> None:
    """Else run docs/site/reference.py."""
    sys.path.insert(0, str(REPOSITORY / "docs/site"))
    try:
        import reference
    finally:
        sys.path.pop(0)
    for name, text in reference.pages().items():
        assert (REPOSITORY / f"docs/reference/{name}.md").read_text("utf-8") == text, name


def test_every_attribute_and_layer_is_explained(tmp_path: Path) -> None:
    clip = write_ffv1(tmp_path / "a.mkv", moving_scene(1))
    out = tmp_path / "out"
    flags = ["--layers", ",".join(LAYERS), "--owner", "a", "--comments", "b", "--timecode", "auto"]
    assert main(["convert", "--quiet", str(clip), str(out), *flags]) == 0
    image = read_exr(out / "a.0001.exr")
    of_exr = {
        "channels", "compression", "dataWindow", "displayWindow", "lineOrder", "type",
        "screenWindowCenter", "screenWindowWidth",
    }  # fmt: skip
    of_some = {"acesImageContainerFlag", "itmoSourceDamaged"}
    assert set(image.attributes) - of_exr == set(ATTRIBUTES) - of_some
    assert set(image.channels) - set("RGB") == set(LAYER_CHANNELS)
