"""Prose: counts as people say them, and the terms of the trade in docs, help and messages."""

from __future__ import annotations

import ast
import re
import tokenize
from pathlib import Path

import pytest
from clips import REPOSITORY, moving_scene, write_ffv1

from itmo_video.cli.main import main
from itmo_video.output.disk_space import in_words
from itmo_video.words import counted, frames_are, missing

DOCS = sorted((REPOSITORY / "docs").glob("*.md"))


def test_one_has_no_s() -> None:
    assert [frames_are(text) for text in ("7", "7-9", "1,3")] == [
        "frame 7 is", "frames 7-9 are", "frames 1,3 are",
    ]  # fmt: skip
    assert [counted(n, "frame") for n in (0, 1, 2)] == ["0 frames", "1 frame", "2 frames"]
    assert missing(1, "frame") == "1 frame is missing"
    assert missing(3, "frame") == "3 frames are missing"


def test_sizes_are_never_zero_megabytes() -> None:
    sizes = {2_345: "2 kB", 1_240_000: "1.2 MB", 45_400_000: "45 MB", 12_300_000_000: "12.3 GB"}
    assert {count: in_words(count) for count in sizes} == sizes


def test_one_frame_is_not_there_and_many_are_ranges(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    clip = str(write_ffv1(tmp_path / "a.mkv", moving_scene(6)))
    assert main(["convert", clip, str(tmp_path / "out"), "--frames", "1000"]) == 2
    assert "frame 1000 is not in the clip\nIt has frames 1-6." in capsys.readouterr().err
    assert main(["convert", clip, str(tmp_path / "out"), "--frames", "2"]) == 0
    capsys.readouterr()
    assert main(["convert", clip, str(tmp_path / "out"), "--verify"]) == 7
    assert f"{tmp_path / 'out'}: frames 1,3-6: missing" in capsys.readouterr().err
    assert main(["preview", str(tmp_path / "out" / "a.0002.exr"), str(tmp_path / "a.png")]) == 6
    assert "give its folder: itmo-video preview FOLDER" in capsys.readouterr().err


def test_one_frame_is_made(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    clip = write_ffv1(tmp_path / "a.mkv", moving_scene(1))
    assert main(["convert", str(clip), str(tmp_path / "out"), "--dry-run"]) == 0
    assert "1 frame (1) of" in capsys.readouterr().out
    assert main(["convert", str(clip), str(tmp_path / "out")]) == 0
    told = capsys.readouterr().err
    assert "1 frame rendered" in told
    assert told.count("assumed") == 1, "one notice a clip for all that was assumed"


def test_a_flat_picture_for_lighting_is_asked_whether_it_is_a_panorama(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    clip = str(write_ffv1(tmp_path / "a.mkv", moving_scene(1, width=128, height=64)))
    for flags, told in (
        (["--preset", "ibl"], True),
        (["--preset", "ibl", "--projection", "latlong"], False),
        ([], False),
    ):
        assert main(["convert", clip, str(tmp_path / "out"), "--null", *flags]) == 0
        said = "".join(capsys.readouterr())
        assert ("add --projection latlong" in said) == told, flags


def test_no_flag_is_called_after_its_variable(capsys: pytest.CaptureFixture[str]) -> None:
    for command in ("convert", "preview", "analyse", "evaluate", "report"):
        with pytest.raises(SystemExit):
            main([command, "--help"])
        told = capsys.readouterr().out
        assert "SET_" not in told
        assert "without a preset" not in told


AVOIDED = {  # a pattern in prose, and what to write; meant in the senses of ../shared/docs/words.md
    r"\bno right to\b": "permission denied",
    r"\bgoes? on where|command goes on\b": "resume",
    r"\bmake(s)? again|made again what\b": "re-render",
    r"\bmend(s|ed|ing)?\b": "repair, correct, fix",
    r"\bdear(er|est)?\b": "expensive",
    r"\bwhose it is\b": "owner",
    r"\bfrankly\b": "leave it out",
    r"\bto look at it by|to judge (it )?by\b": "preview, QC",
    r"\bsays of itself\b": "metadata",
    r"(?<!there )\bis no (name|number|film|picture|shot|time|regular)\b": "is not a",
    r"\bpicture sequence\b": "image sequence",
    r"\bframe index number\b": "frame number",
    r"\bkey frame": "keyframe",
    r"\bexpand map\b": "Expand Map",
    r"\bscene cut\b": "cut",
    r"\bimage-based light\b": "image-based lighting",
    r"\bHDR-10\b|\bHDR 10\b": "HDR10",
    r"\bOpen EXR\b": "OpenEXR",
    r"\btime line\b": "timeline",
    r"\bpresent settings\b": "current settings",
    r"\bwithout a word\b": "without a notice",
    r"\bHDR already\b": "already HDR",
    r"\bby custom\b": "usually",
    r"\bdoes not decode\b": "cannot be decoded",
    r"\bstops about SDR white\b": "stops relative to SDR white",
    r"\bexclude each other\b": "cannot be combined",
}


def _flagged(text: str) -> list[str]:
    plain = re.sub(r"`[^`]*`|```.*?```", "", text, flags=re.DOTALL)
    found = []
    for pattern, better in AVOIDED.items():
        flags = 0 if "HDR" in pattern or "expand" in pattern or "EXR" in pattern else re.IGNORECASE
        found += [f"{m[0]!r}: write {better}" for m in re.finditer(pattern, plain, flags)]
    return found


def _pages() -> list[Path]:
    guide = sorted((REPOSITORY / "docs" / "guide").glob("*.md"))
    return [REPOSITORY / "README.md", REPOSITORY / "CONTRIBUTING.md", *DOCS, *guide]


def test_the_docs_use_the_terms_of_the_trade() -> None:
    wrong = {p.name: _flagged(p.read_text("utf-8")) for p in _pages()}
    assert not {name: found for name, found in wrong.items() if found}


def test_messages_help_docstrings_and_comments_use_the_terms_of_the_trade() -> None:
    wrong = []
    for path in sorted((REPOSITORY / "itmo_video").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value:
                wrong += [f"{path.name}:{node.lineno}: {said}" for said in _flagged(node.value)]
        with path.open("rb") as code:
            for token in tokenize.tokenize(code.readline):
                if token.type == tokenize.COMMENT:
                    where = f"{path.name}:{token.start[0]}"
                    wrong += [f"{where}: {said}" for said in _flagged(token.string)]
    assert not wrong


def test_pages_of_studio_and_report_use_the_terms_of_the_trade() -> None:
    wrong = []
    for path in sorted((REPOSITORY / "itmo_video").rglob("*")):
        if path.suffix in (".js", ".html", ".j2", ".c", ".h"):
            plain = path.read_text("utf-8").replace("`", "'")
            wrong += [f"{path.name}: {said}" for said in _flagged(plain)]
    assert not wrong


def test_readme_is_short_has_no_table_of_jod_and_leads_to_what_people_search_for() -> None:
    readme = (REPOSITORY / "README.md").read_text("utf-8")
    assert len(readme.splitlines()) < 120
    assert "JOD |" not in readme
    for term in ("resume", "batch", "HDR10", "Nuke", "ProRes", "flicker"):
        line = next(line for line in readme.splitlines() if term in line and "](" in line)
        for link in re.findall(r"\]\(([^)#]+)", line):
            assert (REPOSITORY / link).exists(), link
