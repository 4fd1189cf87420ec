"""No command writes over a file that is not its own to replace."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import cv2
import pytest
from clips import moving_scene, write_ffv1

from itmo_video.cli.main import main
from itmo_video.errors import OutputError
from itmo_video.output.atomic import temp_path
from itmo_video.output.gate import ANALYSIS, FILM, PAGE, STILL, Gate

SMALL = ("--lights", "64", "--quiet")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A clip, another film, a picture, a sequence, and a folder converted from the clip."""
    top = tmp_path_factory.mktemp("made")
    clip = write_ffv1(top / "clip.mkv", moving_scene(3, width=64, height=48))
    write_ffv1(top / "other.mkv", moving_scene(2, width=64, height=48, seed=5))
    picture = next(iter(moving_scene(1, width=64, height=48)))
    for name in ("photo.png", "s.0001.png", "s.0002.png"):
        cv2.imwrite(str(top / name), picture)
    (top / "notes.html").write_text("<html>my own page</html>")
    (top / "list.json").write_text('{"mine": 1}')
    assert main(["convert", str(clip), str(top / "out"), *SMALL]) == 0
    return top


@pytest.fixture
def place(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    copy = tmp_path / "place"
    shutil.copytree(made, copy)
    os.link(copy / "clip.mkv", copy / "hard.mkv")
    (copy / "soft.mkv").symlink_to("clip.mkv")
    monkeypatch.chdir(copy)
    return copy


def content(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


NEVER = [
    "preview clip.mkv clip.mkv --overwrite",
    "preview clip.mkv hard.mkv --overwrite",
    "preview clip.mkv soft.mkv --overwrite",
    "preview soft.mkv clip.mkv --overwrite",
    "preview clip.mkv ./out/../clip.mkv --overwrite",
    "preview photo.png photo.png --frame 1 --overwrite",
    "preview s.%04d.png s.0002.png --frame 1 --overwrite",
    "preview out other.mkv --source other.mkv --overwrite",
    "preview out clip.mkv --overwrite",  # the folder's source, which nobody named
    "report out --output out/itmo-video.json --overwrite",
    "report out --output out/clip.0001.exr --overwrite",
    "report out --output clip.mkv --overwrite",
    "report out --source clip.mkv --output clip.mkv --overwrite",
    "report out --output notes.html --overwrite",  # a page, but no report
    "report out --output out --overwrite",
    "analyse clip.mkv --output clip.mkv --overwrite",
    "analyse clip.mkv --output other.mkv --overwrite",
    "analyse clip.mkv --output list.json --overwrite",
    "analyse clip.mkv --output out/itmo-video.json --overwrite",
    "evaluate out --reference out --heat-map clip.mp4 --overwrite",
]
UNASKED = [
    "preview clip.mkv other.mkv",
    "preview out other.mkv",
    "preview clip.mkv clip.mkv",
    "preview out clip.mkv",
    "preview clip.mkv photo.png --frame 1",
    "report out --output notes.html",
    "analyse clip.mkv --output list.json",
]


@pytest.mark.parametrize("line", [*NEVER, *UNASKED])
def test_refused_before_any_work(
    line: str, place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if "heat-map" in line:
        shutil.copy("clip.mkv", "clip.mp4")
    before = content(place)
    quiet = () if line.startswith("evaluate") else ("--quiet",)
    assert main([*line.split(), *quiet]) == 5, capsys.readouterr().err
    assert content(place) == before
    told = capsys.readouterr().err
    assert "not written" in told
    assert len(told.splitlines()) <= 2


def test_what_is_asked_for_is_replaced(place: Path) -> None:
    first, film = ("analyse", "clip.mkv", "--output", "a.json"), ("preview", "out", "other.mkv")
    assert main([*first, "--quiet"]) == 0
    assert main([*first, "--quiet"]) == 5
    assert main([*first, "--overwrite", "--quiet"]) == 0
    assert main([*film, "--overwrite", "--speed", "13", "--quiet"]) == 0
    assert main(["report", "out", "--quiet"]) == 0
    assert main(["report", "out", "--quiet"]) == 0, "our own report at its own place is replaced"
    (place / "out/report.html").write_text("<html>mine</html>")
    assert main(["report", "out", "--quiet"]) == 5
    assert main(["convert", "clip.mkv", "out", "--report", *SMALL]) == 5


def test_the_default_report_may_not_be_an_empty_file_of_somebody(place: Path) -> None:
    (place / "out/report.html").touch()
    assert main(["report", "out", "--quiet"]) == 5
    assert main(["report", "out", "--quiet", "--overwrite"]) == 0


@pytest.mark.parametrize("kind", [FILM, STILL, PAGE, ANALYSIS], ids=lambda kind: kind.word)
@pytest.mark.parametrize(
    "make",
    [
        lambda path: os.mkfifo(path),
        lambda path: path.mkdir(),
        lambda path: path.symlink_to("nowhere"),
        lambda path: path.symlink_to("/dev/null"),
        lambda path: path.symlink_to("/dev/zero"),
        lambda path: path.write_bytes(b"somebody's own words"),
    ],
    ids=["fifo", "folder", "broken link", "null", "zero", "text"],
)
def test_what_is_no_file_of_its_kind_stays(
    make: Callable[[Path], object], kind: object, tmp_path: Path
) -> None:
    path = tmp_path / "there"
    make(path)
    with pytest.raises(OutputError, match="not written"):
        Gate(path, kind, overwrite=True).check()  # type: ignore[arg-type]


def test_a_file_that_comes_in_mid_run_stays(tmp_path: Path) -> None:
    gate = Gate(tmp_path / "film.mp4", FILM)
    gate.check()
    (tmp_path / "film.mp4").write_bytes(b"somebody else's, made meanwhile")
    with pytest.raises(OutputError, match="but no film"):
        gate.write(b"\0\0\0\x18ftypisom")
    assert (tmp_path / "film.mp4").read_bytes().startswith(b"somebody")
    assert len(list(tmp_path.iterdir())) == 1, "a temporary file stays"


def test_a_link_to_an_input_that_comes_in_mid_run_is_seen(tmp_path: Path) -> None:
    source, target = tmp_path / "source.mkv", tmp_path / "film.mkv"
    source.write_bytes(b"\x1a\x45\xdf\xa3 the only copy")
    gate = Gate(target, FILM, inputs=[source], overwrite=True)
    gate.check()
    os.link(source, target)
    with pytest.raises(OutputError, match="an input of this command"):
        gate.write(b"\x1a\x45\xdf\xa3 new")
    assert source.read_bytes().endswith(b"the only copy")


def test_where_files_cannot_be_linked_a_rename_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def link(*args: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "link", link)
    Gate(tmp_path / "a.json", ANALYSIS).write(b"{}")
    assert (tmp_path / "a.json").read_bytes() == b"{}"
    assert len(list(tmp_path.iterdir())) == 1


def test_a_killed_runs_temporary_file_is_cleared(tmp_path: Path) -> None:
    own = temp_path(tmp_path / "x")
    dead = own.with_name(own.name.replace(f"-{os.getpid()}-", "-4194305-"))
    for path in (own, dead):
        path.touch()
    Gate(tmp_path / "film.mp4", FILM).check()
    assert [path.name for path in tmp_path.iterdir()] == [own.name]


def test_a_missing_folder_is_told_before_the_work(place: Path) -> None:
    assert main(["preview", "clip.mkv", "no/such/film.mkv", "--quiet"]) == 5


@pytest.mark.parametrize("source", ["s.%04d.png", "photo.png"])
def test_pictures_become_a_film_without_sound(source: str, place: Path) -> None:
    assert main(["preview", source, "new.mkv", "--speed", "13", "--quiet"]) == 0


@pytest.mark.parametrize("kind", ["playlist", "fifo", "zero", "text", "folder", "missing"])
def test_a_folders_source_is_as_safe_as_an_input(
    kind: str, place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    odd = place / f"odd.{'m3u8' if kind == 'playlist' else 'mkv'}"
    if kind == "playlist":
        odd.write_text("#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\nother.mkv\n#EXT-X-ENDLIST\n")
    elif kind == "fifo":
        os.mkfifo(odd)
    elif kind == "zero":
        odd.symlink_to("/dev/zero")
    elif kind == "text":
        odd.write_text("no film")
    elif kind == "folder":
        odd.mkdir()
    for view in ("hdr10", "compare"):
        line = ["preview", "out", "new.mkv", "--as", view, "--source", str(odd), "--quiet"]
        assert main(line) == 3, capsys.readouterr().err
    assert main(["report", "out", "--source", str(odd), "--quiet"]) == 3
    assert not (place / "new.mkv").exists()
    assert not [path for path in place.iterdir() if path.suffix == ".tmp"]
