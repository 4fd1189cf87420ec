"""What preview, report and analyse do when a source or a folder goes away while they work."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from clips import moving_scene, write_ffv1

from itmo_video.cli.main import main
from itmo_video.cli.progress import Progress
from itmo_video.events import FrameDone

LINES = {
    "preview": "preview {clip} {new}/film.y4m",
    "preview a film": "preview {clip} {new}/film.mp4 --codec hevc --speed ultrafast",
    "preview of a folder": "preview {folder} {new}/film.y4m",
    "report": "report {folder} --output {new}/page.html",
    "report with its source": "report {folder} --source {clip} --output {new}/page.html",
    "analyse": "analyse {clip} --output {new}/a.json",
}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    top = tmp_path_factory.mktemp("made")
    clip = write_ffv1(top / "c.mkv", moving_scene(30, width=64, height=48))
    line = ["convert", str(clip), str(top / "o"), "--lights", "16", "--quiet"]
    assert main([*line, "--temporal", "per-frame"]) == 0
    return top


def run(
    line: str, place: Path, taken: Callable[[], None], monkeypatch: pytest.MonkeyPatch
) -> tuple[int, bool]:
    """The exit code of a command in whose midst something is taken away; whether it was."""
    done = False

    def on_event(self: Progress, event: object) -> None:
        nonlocal done
        if isinstance(event, FrameDone) and not done:
            done = True
            taken()

    monkeypatch.setattr(Progress, "on_event", on_event)
    filled = line.format(clip=place / "c.mkv", folder=place / "o", new=place / "new").split()
    if line.startswith(("preview {clip}", "analyse")):
        filled += ["--jobs", "1"] if line.startswith("preview") else []
        filled += ["--lights", "16", "--temporal", "per-frame", "--smooth-keys", "0"]
    return main(filled), done


CASES = [
    (name, what)
    for name, line in LINES.items()
    for what, needed in (
        ("output", "new"), ("folder", "folder"), ("frames", "folder"), ("clip", "clip"),
    )
    if f"{{{needed}}}" in line
]  # fmt: skip


@pytest.mark.parametrize(("name", "what"), CASES)
def test_it_is_told(
    name: str,
    what: str,
    made: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    line = LINES[name]
    place = Path(shutil.copytree(made, tmp_path / "place"))
    (place / "new").mkdir()

    def taken() -> None:
        if what == "frames":
            for path in sorted((place / "o").glob("*.exr"))[20:]:
                path.unlink()
        elif what == "clip":
            (place / "c.mkv").unlink()
        else:
            shutil.rmtree(place / {"output": "new", "folder": "o"}[what])

    code, was_taken = run(line, place, taken, monkeypatch)
    told = capsys.readouterr().err
    assert was_taken
    assert code == (4 if what == "clip" else 5), told
    assert "unexpected" not in told
    assert 1 <= len(told.splitlines()) <= 2, told
    if what == "output":
        assert not (place / "new").exists(), "it was made again"
    else:
        whole = [path.name for path in (place / "new").iterdir()]
        assert whole == (["film.y4m"] if what == "clip" and name == "preview" else []) or (
            what == "clip" and whole == ["film.mp4"]
        )
