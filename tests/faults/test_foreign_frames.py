"""What lies in a converted folder is what its conversion wrote: all readers look at it one way."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from clips import moving_scene, write_ffv1
from command import COMMAND

from itmo_video import open_result
from itmo_video.cli.main import main
from itmo_video.conversion.plan import ALGORITHM
from itmo_video.errors import InputError, OutputError
from itmo_video.output import fingerprint
from itmo_video.output.converted import open_converted
from itmo_video.output.manifest import MANIFEST_NAME
from itmo_video.words import frames_are

QUICK = ("--lights", "64", "--quiet")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two clips, a folder of each, and one of the first with other settings; of 6 frames."""
    top = tmp_path_factory.mktemp("made")
    for name, seed in (("c", 0), ("other", 5)):
        write_ffv1(top / f"{name}.mkv", moving_scene(6, width=64, height=48, seed=seed))
        assert main(["convert", str(top / f"{name}.mkv"), str(top / name), *QUICK]) == 0
    line = ["convert", str(top / "c.mkv"), str(top / "dim"), "--peak-nits", "300", *QUICK]
    assert main(line) == 0
    return top


@pytest.fixture
def folder(made: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(made / "c", tmp_path / "c"))


def readers(made: Path, folder: Path, source: Path | None = None) -> dict[str, list[str]]:
    """A line of each command that reads a folder."""
    source = source or made / "c.mkv"
    out, truth = folder.parent, str(made / "c")
    return {
        "preview": ["preview", str(folder), str(out / "a.y4m")],
        "compare": ["preview", str(folder), str(out / "b.y4m"), "--as", "compare",
                    "--source", str(source)],
        "report": ["report", str(folder), "--output", str(out / "page.html")],
        "flicker": ["evaluate", str(folder), "--source", str(source), "--json"],
        "fidelity": ["evaluate", str(folder), "--reference", truth, "--json"],
    }  # fmt: skip


STRANGERS: dict[str, Callable[[Path], Path]] = {
    "another film's": lambda made: made / "other/other.0003.exr",
    "of other settings": lambda made: made / "dim/c.0003.exr",
    "of another number": lambda made: made / "c/c.0002.exr",
}

TOLD = {
    "another film's": "source, number or version differ",
    "of other settings": r"settings differ \(l-max .* peak-nits 300 -> 1000\)",
    "of another number": "source, number or version differ",
}


@pytest.mark.parametrize("kind", STRANGERS)
def test_a_frame_that_is_not_the_folders_is_refused(
    kind: str, made: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copy(STRANGERS[kind](made), folder / "c.0003.exr")
    for name, line in readers(made, folder).items():
        assert main(line) == 3, name
        assert "c.0003.exr: not a frame of this folder" in capsys.readouterr().err, name
    with pytest.raises(InputError, match=f"not a frame of this folder: its {TOLD[kind]}"):
        open_result(folder)[3]
    assert open_result(folder)[2].index == 1
    assert not list(folder.parent.glob("*.y4m"))
    # As a truth, too.
    line = ["evaluate", str(made / "c"), "--reference", str(folder), "--json"]
    assert main(line) == 3


@pytest.mark.parametrize("settings", ["[" * 20_000, '{"a":' * 20_000, "9" * 20_000, "[NaN]", "{"])
def test_a_frame_with_hostile_settings_is_refused(
    settings: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """They are read to name what differs; the parser's own RecursionError was unexpected (1)."""
    attributes = {"itmoFingerprint": "0" * 32, "itmoSettings": settings}
    rgb = np.zeros((48, 64, 3), np.float16)
    OpenEXR.File(attributes, {"RGB": rgb}).write(str(folder / "c.0003.exr"))
    assert main(["preview", str(folder), str(folder.parent / "a.y4m")]) == 3
    assert "c.0003.exr: not a frame of this folder" in capsys.readouterr().err


def test_a_frame_of_another_compression_is_told(made: Path, folder: Path) -> None:
    data = (folder / "c.0003.exr").read_bytes()
    at = data.index(b"dataWindow\0box2i\0") + len(b"dataWindow\0box2i\0") + 4
    moved = bytes([8, 0, 0, 0]) + data[at + 4 : at + 8] + bytes([71, 0, 0, 0])
    (folder / "c.0003.exr").write_bytes(data[:at] + moved + data[at + 12 :])
    with pytest.raises(InputError, match="modified since it was converted"):
        open_converted(folder).read(3)


def test_shots_and_older_manifests_are_known(
    made: Path, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A folder with shots of their own, and manifests of before they named the algorithm."""
    monkeypatch.setattr(fingerprint, "_UNTOLD_ALGORITHMS", (1, ALGORITHM))
    listed = tmp_path / "a.json"
    assert main(["analyse", str(made / "c.mkv"), "--output", str(listed), "--quiet"]) == 0
    found = json.loads(listed.read_text())
    found["shots"] = [{"first": 2, "last": 4, "peak_nits": 600, "lights": 128}]
    listed.write_text(json.dumps(found))
    line = ["convert", str(made / "c.mkv"), str(tmp_path / "o"), "--analysis", str(listed)]
    assert main([*line, *QUICK]) == 0
    for made_folder in (tmp_path / "o", folder):
        for is_old in (False, True):
            path = made_folder / MANIFEST_NAME
            manifest = json.loads(path.read_text())
            if is_old:
                del manifest["source_frames"], manifest["settings"]["algorithm"]
            path.write_text(json.dumps(manifest))
            opened = open_converted(made_folder)
            for number in opened.numbers:
                assert opened.read(number).size == (64, 48)
    assert main([*line, *QUICK]) == 0, "an older folder of the same settings goes on"


@pytest.mark.parametrize("view", ["hdr10", "compare"])
def test_another_source_is_refused(
    view: str, made: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = str(made / "other.mkv")
    out = str(folder.parent / "a.y4m")
    lines = [["preview", str(folder), out, "--as", view, "--source", other]]
    if view == "hdr10":
        lines += [
            ["evaluate", str(folder), "--source", other],
            ["evaluate", str(folder), "--reference", str(made / "c"), "--source", other],
            ["report", str(folder), "--source", other],
        ]
    for line in lines:
        assert main(line) == 3, line
        told = capsys.readouterr().err
        assert "not the clip that the folder was converted from ('c.mkv')" in told
        assert len(told.splitlines()) == 2, "without a remedy"
    shutil.copy(made / "c.mkv", folder.parent / "renamed.mkv")
    lines[0][-1] = str(folder.parent / "renamed.mkv")
    assert main(lines[0]) == 0, "the same content under another name is the same film"


@pytest.mark.parametrize(
    ("gone", "told"), [((3,), "3"), ((1, 4, 5), "1,4-5"), ((6,), "6"), ((1, 2, 3, 4, 6), "1-4,6")]
)
def test_frames_that_are_not_there_are_told(
    gone: tuple[int, ...],
    told: str,
    made: Path,
    folder: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    for number in gone:
        (folder / f"c.{number:04d}.exr").unlink()
    for name, line in readers(made, folder).items():
        assert main(line) == 0, name
        assert f"{frames_are(told)} not in the folder" in capsys.readouterr().err, name
    assert f"{frames_are(told).capitalize()} not" in (folder.parent / "page.html").read_text()
    assert open_result(folder).absent == told
    assert f"{told} absent" in repr(open_result(folder))
    line = ["preview", str(folder), str(folder.parent / "s.png"), "--frame", "5"]
    assert main(line) == (2 if 5 in gone else 0)


def test_a_whole_folder_tells_nothing(
    made: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for line in readers(made, folder).values():
        assert main(line) == 0
        assert "not in the folder" not in capsys.readouterr().err


def test_a_folder_made_of_a_pipe_has_no_source_to_be_read_again(
    made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    frame = bytes(range(96)) * 48  # 64x48 of yuv420p
    out = tmp_path / "o"
    line = ["convert", "-", str(out), "--raw", "yuv420p:64x48:25", "--lights", "16"]
    subprocess.run([*COMMAND, *line], input=2 * frame, check=True, capture_output=True)
    assert open_result(out).absent is None
    assert main(["preview", str(out), str(tmp_path / "a.y4m")]) == 0
    capsys.readouterr()
    for more in (["report"], ["evaluate"]):
        assert main([*more, str(out), "--source", str(made / "c.mkv")]) == 3
        assert "not the clip that the folder was converted from" in capsys.readouterr().err


@pytest.mark.parametrize("count", [10**18, -5, True, "6"])
def test_a_count_that_somebody_made_up(count: object, folder: Path) -> None:
    manifest = json.loads((folder / MANIFEST_NAME).read_text())
    manifest["source_frames"] = count
    (folder / MANIFEST_NAME).write_text(json.dumps(manifest))
    if count == 10**18:
        assert open_converted(folder).absent == f"7-{10**18}"
    else:
        with pytest.raises(InputError, match="source_frames"):
            open_converted(folder)


@pytest.mark.parametrize("what", ["frame", "folder"])
def test_a_folder_that_vanishes_in_mid_run(what: str, folder: Path) -> None:
    opened = open_converted(folder)
    assert opened.read(1).size == (64, 48)
    shutil.rmtree(folder) if what == "folder" else (folder / "c.0002.exr").unlink()
    with pytest.raises(OutputError, match="disappeared while") as caught:
        opened.read(2)
    assert caught.value.exit_code == 5
