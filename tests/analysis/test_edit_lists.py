"""Edit lists in and out: OpenTimelineIO and CMX3600, against a plain reading of the text."""

from __future__ import annotations

import json
import re
import sys
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest
from clips import moving_scene, write_ffv1

from itmo_video import analyse, open_clip
from itmo_video.analysis import edit_lists
from itmo_video.analysis.edit_lists import edit_of, read_edit
from itmo_video.analysis.model import Analysis, Shot
from itmo_video.cli.main import main
from itmo_video.errors import InputError, ItmoError, UsageError
from itmo_video.model import ClipInfo

pytest.importorskip("opentimelineio", reason="opentimelineio is not installed")

EDL = """TITLE: CUT
FCM: NON-DROP FRAME

001  AX       V     C        00:00:10:00 00:00:10:04 01:00:00:00 01:00:00:04
* FROM CLIP NAME: one.mov
002  AX       V     C        00:00:20:00 00:00:20:03 01:00:00:05 01:00:00:08
"""
EVENT = re.compile(r"^\d+ .* C +(\S+) (\S+) (\S+) (\S+)\s*$", re.MULTILINE)


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("edit")
    return write_ffv1(folder / "c.mkv", moving_scene(8, cuts=(4,)))


@pytest.fixture(scope="module")
def found(clip: Path) -> Analysis:
    return analyse(clip)


@pytest.fixture(scope="module")
def info(clip: Path) -> ClipInfo:
    with open_clip(clip) as opened:
        return opened.info


def frames(code: str, rate: int) -> int:
    hours, minutes, seconds, frame = map(int, re.split("[:;]", code))
    return ((hours * 60 + minutes) * 60 + seconds) * rate + frame


def ranges(analysis: Analysis) -> list[tuple[int, int]]:
    return [(shot.first - 1, shot.last - 1) for shot in analysis.shots]


@pytest.mark.parametrize("rate", [Fraction(24), Fraction(24000, 1001), Fraction(25),
                                  Fraction(30000, 1001), Fraction(60)])  # fmt: skip
@pytest.mark.parametrize("suffix", [".otio", ".edl"])
def test_what_is_written_is_read_again(
    found: Analysis, info: ClipInfo, tmp_path: Path, suffix: str, rate: Fraction
) -> None:
    clip = replace(info, frame_rate=rate)
    path = tmp_path / f"a{suffix}"
    path.write_text(edit_of(found, clip, suffix))
    assert read_edit(path, clip) == ranges(found) == [(0, 3), (4, 7)]


def test_frames_in_no_shot_are_a_gap(found: Analysis, info: ClipInfo, tmp_path: Path) -> None:
    some = replace(found, shots=(Shot(1, 2), Shot(4, 8)))
    for suffix in (".otio", ".edl"):
        path = tmp_path / f"a{suffix}"
        path.write_text(edit_of(some, info, suffix))
        assert read_edit(path, info) == [(0, 1), (3, 7)]


def test_the_edl_is_plain_cmx3600(found: Analysis, info: ClipInfo) -> None:
    """Read by hand: source times go on from the clip's timecode, record times are the shots."""
    text = edit_of(found, replace(info, timecode="02:00:00:00"), ".edl")
    assert text.startswith("TITLE: c\n")
    events = [[frames(code, 24) for code in event] for event in EVENT.findall(text)]
    source = 2 * 3600 * 24
    begin = events[0][2]
    assert [e[:2] for e in events] == [[source, source + 4], [source + 4, source + 8]]
    assert [[e[2] - begin, e[3] - begin] for e in events] == [[0, 4], [4, 8]]


def test_otio_has_the_keyframes_as_markers(found: Analysis, info: ClipInfo) -> None:
    document = json.loads(edit_of(found, info, ".otio"))
    assert document["OTIO_SCHEMA"].startswith("Timeline.")
    clips = document["tracks"]["children"][0]["children"]
    assert [clip["name"] for clip in clips] == ["c 001", "c 002"]
    keys = [m["marked_range"]["start_time"]["value"] + 1 for c in clips for m in c["markers"]]
    assert keys == list(found.keyframes)


def test_an_editors_edl_gives_the_shots(clip: Path, tmp_path: Path) -> None:
    edl, shots = tmp_path / "cut.edl", tmp_path / "shots.json"
    edl.write_text(EDL)
    assert main(["analyse", str(clip), "--shots", str(edl), "--output", str(shots)]) == 0
    data = json.loads(shots.read_text())
    assert [(s["first"], s["last"]) for s in data["shots"]] == [(1, 4), (6, 8)]
    assert data["cuts"] == [5], "cuts are found in the frames, whatever the edit says"
    assert all(shot["statistics"] for shot in data["shots"])
    out = tmp_path / "back.edl"
    flags = ["--shots", str(edl), "--output", str(out)]
    assert main(["analyse", str(clip), *flags]) == 0
    with open_clip(clip) as opened:
        assert read_edit(out, opened.info) == [(0, 3), (5, 7)]
    plus = tmp_path / "plus.json"
    assert main(["analyse", str(clip), "--shots", str(edl), "--hdr10plus", str(plus)]) == 0
    summary = json.loads(plus.read_text())["SceneInfoSummary"]
    assert summary == {"SceneFirstFrameIndex": [0, 4, 5], "SceneFrameNumbers": [4, 1, 3]}


def test_two_tracks_are_seen_from_above(info: ClipInfo, tmp_path: Path) -> None:
    otio = pytest.importorskip("opentimelineio")
    time, span = otio.opentime.RationalTime, otio.opentime.TimeRange
    timeline = otio.schema.Timeline("two")
    for parts in ([("c", 8)], [("g", 2), ("c", 3)]):
        track = otio.schema.Track(kind="Video")
        for kind, length in parts:
            of = otio.schema.Clip if kind == "c" else otio.schema.Gap
            track.append(of(source_range=span(time(0, 48), time(2 * length, 48))))
        timeline.tracks.append(track)
    timeline.tracks.append(otio.schema.Track(kind="Audio"))
    path = tmp_path / "two.otio"
    path.write_text(otio.adapters.write_to_string(timeline, "otio_json"))
    assert read_edit(path, info) == [(0, 1), (2, 4), (5, 7)]


def test_what_an_editor_does_not_show_is_no_shot(info: ClipInfo, tmp_path: Path) -> None:
    """Disabled tracks and clips; a track inside a track is a shot, as a stack is."""
    otio = pytest.importorskip("opentimelineio")
    time, span = otio.opentime.RationalTime, otio.opentime.TimeRange

    def clip(frames: int, enabled: bool = True) -> object:
        made = otio.schema.Clip(source_range=span(time(0, 24), time(frames, 24)))
        made.enabled = enabled
        return made

    inner, lower, upper, off = (otio.schema.Track(kind="Video") for _ in range(4))
    inner.extend([clip(1), clip(1)])
    lower.extend([clip(2), inner, clip(1, enabled=False), clip(3)])
    upper.extend([clip(1, enabled=False), clip(1)])
    off.append(clip(8))
    off.enabled = False
    timeline = otio.schema.Timeline("shown")
    timeline.tracks.extend([lower, upper, off])
    path = tmp_path / "shown.otio"
    path.write_text(otio.adapters.write_to_string(timeline, "otio_json"))
    assert read_edit(path, info) == [(0, 0), (1, 1), (2, 3), (5, 7)]


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.edl", EDL.replace("01:00:00:08", "01:00:00:09"), "."),
        ("a.edl", EDL.replace("00:00:20:03", "00:00:29:00").replace(":00:08", ":09:05"), "frames"),
        ("a.edl", "TITLE: X\n", "no shot"),
        ("a.edl", "001 nonsense\n", "not a valid edit list"),
        ("a.otio", "{}", "not a valid edit list"),
        ("a.otio", "[" * 100000, "."),
        ("a.otio", '{"OTIO_SCHEMA": "Clip.2"}', "not a valid edit list"),
        ("a.xml", "<x/>", "edit lists must be"),
    ],
)
def test_what_is_no_edit_of_the_clip_is_refused(
    info: ClipInfo, tmp_path: Path, name: str, text: str, words: str
) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(ItmoError, match=words) as caught:
        read_edit(tmp_path / name, info)
    assert isinstance(caught.value, InputError | UsageError)


def test_without_the_extra_it_is_told(
    info: ClipInfo, found: Analysis, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "opentimelineio", None)
    with pytest.raises(UsageError, match="opentimelineio") as caught:
        edit_of(found, info, ".otio")
    assert "pip install '.[otio]'" in str(caught.value)
    assert edit_lists.is_edit_list("A.EDL")


def test_a_file_of_somebodys_is_left_alone(clip: Path, tmp_path: Path) -> None:
    path = tmp_path / "mine.edl"
    path.write_text("my notes\n")
    assert main(["analyse", str(clip), "--output", str(path), "--overwrite"]) == 5
    assert path.read_text() == "my notes\n"


@pytest.mark.parametrize("name", ["a.edl", "a.otio"])
def test_an_edit_list_is_replaced_where_that_is_asked_for(
    clip: Path, tmp_path: Path, name: str
) -> None:
    flags = ["analyse", str(clip), "--output", str(tmp_path / name), "--quiet"]
    assert [main(flags), main(flags), main([*flags, "--overwrite"])] == [0, 5, 0]


NTSC = Fraction(30000, 1001)


@pytest.mark.parametrize("mark", ["FCM: DROP FRAME\n", ""])
def test_drop_frame_lists_count_frames(info: ClipInfo, tmp_path: Path, mark: str) -> None:
    """By SMPTE 12M: 00:01:00;02 follows 00:00:59;29, and 01:00:00;00 is frame 107892."""
    sep = ":" if mark else ";"
    text = f"TITLE: D\n{mark}\n" + "".join(
        f"{n:03d}  R{{1}}  V  C  {a} {b} {c} {d}\n".replace("|", sep)
        for n, (a, b, c, d) in enumerate(
            [
                ("00:00:59|20", "00:01:00|12", "01:00:59|20", "01:01:00|12"),  # 20 frames
                ("00:00:00|00", "00:00:00|08", "01:01:00|12", "01:01:00|20"),
            ],
            1,
        )
    )
    path = tmp_path / "drop.edl"
    path.write_text(text)
    long = replace(info, frame_rate=NTSC, frames=28)
    assert read_edit(path, long) == [(0, 19), (20, 27)]
    doubled = replace(info, frame_rate=2 * NTSC, frames=40)
    with pytest.raises(UsageError, match="frames"):  # other numbers are dropped at 59.94
        read_edit(path, doubled)


@pytest.mark.parametrize("suffix", [".edl", ".otio"])
def test_a_drop_frame_clip_has_its_list(
    found: Analysis, info: ClipInfo, tmp_path: Path, suffix: str
) -> None:
    clip = replace(info, frame_rate=NTSC, timecode="00:08:59;27")
    text = edit_of(found, clip, suffix)
    if suffix == ".edl":
        assert "FCM: DROP FRAME" in text
        assert EVENT.findall(text) == [
            ("00:08:59;27", "00:09:00;03", "01:00:00;00", "01:00:00;04"),
            ("00:09:00;03", "00:09:00;07", "01:00:00;04", "01:00:00;08"),
        ]
    else:
        clips = json.loads(text)["tracks"]["children"][0]["children"]
        first = 9 * 1800 - 3 - 16  # eight minutes have dropped two numbers each
        assert [c["source_range"]["start_time"]["value"] for c in clips] == [first, first + 4]
    path = tmp_path / f"a{suffix}"
    path.write_text(text)
    assert read_edit(path, clip) == [(0, 3), (4, 7)]


def test_record_times_start_at_one_hour(found: Analysis, info: ClipInfo) -> None:
    text = edit_of(found, replace(info, path="{0}.mov"), ".edl")
    assert [event[2:] for event in EVENT.findall(text)] == [
        ("01:00:00:00", "01:00:00:04"),
        ("01:00:00:04", "01:00:00:08"),
    ]


@pytest.mark.parametrize("code", ["01:00:00:24", "noon"])
def test_a_timecode_that_the_rate_does_not_have(found: Analysis, info: ClipInfo, code: str) -> None:
    with pytest.raises(UsageError, match="timecode"):
        edit_of(found, replace(info, timecode=code), ".edl")
