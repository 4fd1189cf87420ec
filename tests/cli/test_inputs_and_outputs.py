"""What `convert` makes of names: folders that are none, pictures as the shell lists them."""

from __future__ import annotations

from pathlib import Path

import cv2
import pytest
from clips import moving_scene, write_ffv1

from itmo_video import RunOptions, analyse, convert, open_clip
from itmo_video.cli.main import main
from itmo_video.cli.outputs import named
from itmo_video.errors import UsageError


def pictures(folder: Path, names: list[str]) -> list[str]:
    folder.mkdir(parents=True, exist_ok=True)
    for name, codes in zip(names, moving_scene(len(names), width=48, height=32), strict=True):
        cv2.imwrite(str(folder / name), codes)
    return [str(folder / name) for name in names]


def exrs(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*.exr"))


@pytest.mark.parametrize(
    ("name", "meant"),
    [
        ("-", "preview"), ("film.mp4", "preview"), ("FILM.MOV", "preview"), ("out.exr", "out/"),
        ("still.jpg", "--frame"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("more", [[], ["--dry-run"], ["--verify"], ["--null"]])
def test_a_name_that_is_no_folders_is_refused(
    tmp_path: Path, name: str, meant: str, more: list[str],
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    clip = write_ffv1(tmp_path / "clip.mkv", moving_scene(1))
    monkeypatch.chdir(tmp_path)
    assert main(["convert", "clip.mkv", name, *more]) == 2
    assert meant in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["clip.mkv"]
    with pytest.raises(UsageError):
        convert(clip, name)


def test_a_folder_may_have_any_name(tmp_path: Path) -> None:
    clip = write_ffv1(tmp_path / "clip.mkv", moving_scene(1))
    assert main(["convert", str(clip), f"{tmp_path}/out.mp4/", "--quiet"]) == 0
    assert exrs(tmp_path) == ["out.mp4/clip.0001.exr"]
    assert main(["convert", str(clip), str(tmp_path / "out.mp4"), "--quiet"]) == 0, "it is there"
    assert main(["convert", str(clip), str(tmp_path / "clip.v2"), "--quiet"]) == 0


def test_what_the_shell_lists_is_a_sequence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    listed = pictures(tmp_path / "in", [f"img.{n:04d}.png" for n in range(7, 12)])
    assert main(["convert", *reversed(listed), str(tmp_path / "out")]) == 0
    assert "5 pictures are read as one sequence" in capsys.readouterr().err
    assert exrs(tmp_path / "out") == [f"img.{n:04d}.exr" for n in range(7, 12)]
    convert(tmp_path / "in" / "img.%04d.png", tmp_path / "out")  # the same to the byte: joined


def test_a_part_of_a_sequence_is_that_part(tmp_path: Path) -> None:
    listed = pictures(tmp_path / "in", [f"img_{n}.png" for n in range(8, 13)])
    assert main(["convert", *listed[1:4], str(tmp_path / "out"), "--quiet"]) == 0
    assert exrs(tmp_path / "out") == ["img.0009.exr", "img.0010.exr", "img.0011.exr"]


def test_pictures_with_gaps_and_films_stay_apart(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    listed = pictures(tmp_path / "in", ["a.0001.png", "a.0004.png", "b1.jpg", "b02.jpg"])
    films = [str(write_ffv1(tmp_path / f"f{n}.mkv", moving_scene(1))) for n in (1, 2)]
    assert main(["convert", *listed, *films, str(tmp_path / "out")]) == 0
    assert "gaps" in capsys.readouterr().err
    assert exrs(tmp_path / "out") == [
        "a.0001/a.0001.exr", "a.0004/a.0004.exr", "b02/b02.0001.exr", "b1/b1.0001.exr",
        "f1/f1.0001.exr", "f2/f2.0001.exr",
    ]  # fmt: skip


def test_a_numbered_picture_keeps_its_number(tmp_path: Path) -> None:
    (picture,) = pictures(tmp_path, ["img.0042.png"])
    convert(picture, tmp_path / "out")
    convert(picture, tmp_path / "other", run=RunOptions(start_number=7))
    assert exrs(tmp_path / "out") == ["img.0042.exr"]
    assert exrs(tmp_path / "other") == ["img.0007.exr"], "asked for"
    (plain,) = pictures(tmp_path, ["IMG_0042.jpg"])
    convert(plain, tmp_path / "plain")
    assert exrs(tmp_path / "plain") == ["IMG_0042.0001.exr"], "that number is part of its name"


def test_a_start_number_is_not_ignored(tmp_path: Path) -> None:
    pictures(tmp_path / "in", ["img.0005.png", "img.0006.png"])
    pattern = str(tmp_path / "in" / "img.%04d.png")
    command = ["convert", pattern, str(tmp_path / "out"), "--quiet", "--start-number"]
    assert main([*command, "1"]) == 2
    assert not (tmp_path / "out").exists()
    assert main([*command, "5"]) == 0
    with pytest.raises(UsageError, match="its own numbers"):
        analyse(pattern, start_number=1)
    with open_clip(pattern) as clip:
        assert clip.info.first_number == 5


def test_inputs_of_one_stem_are_told_apart_by_a_template(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    both = [str(write_ffv1(_made(tmp_path / p) / "c.mkv", moving_scene(1))) for p in ("x", "y")]
    out = str(tmp_path / "out")
    assert main(["convert", *both, out]) == 2
    assert "--name '{parent}-{stem}'" in capsys.readouterr().err
    assert not Path(out).exists()
    assert main(["convert", *both, out, "--name", "{parent}/{stem}_{number}", "--quiet"]) == 0
    assert exrs(Path(out)) == ["x/c_1/c.0001.exr", "y/c_2/c.0001.exr"]


def _made(folder: Path) -> Path:
    folder.mkdir()
    return folder


@pytest.mark.parametrize(
    "template", ["{nobody}", "{", "..", "/tmp/{stem}", "a//b", "", "{stem[9]}"]
)
def test_a_template_that_is_none_is_told(template: str) -> None:
    with pytest.raises(UsageError, match=r"--name(:| .* is invalid)"):
        named(["a.mkv", "b.mkv"], "out", template)


def test_names_that_differ_in_their_ending_are_told_apart() -> None:
    with pytest.raises(UsageError) as caught:
        named(["in/a.png", "in/a.jpg"], "out", None)
    assert "{stem}-{suffix}" in str(caught.value)
