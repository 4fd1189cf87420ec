"""Sound of previews: its tracks' tags, unknown codecs, captures that begin at any time."""

from __future__ import annotations

import json
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from av.audio.stream import AudioStream
from clips import SHARED

from itmo_video.cli.main import main

REPORTS = SHARED / "data/field_reports"


def write_clip(
    path: Path, tracks: list[dict[str, str]], default: int = 0, start_s: int = 0
) -> Path:
    """A clip of 12 frames with AAC tracks of half a second, with these tags."""
    with av.open(str(path), "w") as box:
        video = box.add_stream("mpeg4", rate=24)
        video.width, video.height, video.pix_fmt = 64, 48, "yuv420p"
        sounds: list[AudioStream] = []
        for number, tags in enumerate(tracks):
            sound = box.add_stream("aac", rate=48000)
            sound.metadata.update(tags)
            sound.disposition = av.stream.Disposition(int(number == default))
            sounds.append(sound)
        for n in range(12):
            frame = av.VideoFrame.from_ndarray(np.full((48, 64, 3), 20 * n, np.uint8), "rgb24")
            frame = frame.reformat(format="yuv420p", threads=1)
            frame.pts, frame.time_base = n + 24 * start_s, Fraction(1, 24)
            box.mux(video.encode(frame))
            for sound in sounds:
                tone = av.AudioFrame.from_ndarray(np.zeros((1, 2000), np.float32), "fltp", "mono")
                tone.sample_rate, tone.pts = 48000, 2000 * n + 48000 * start_s
                box.mux(sound.encode(tone))
        box.mux(video.encode())
        for sound in sounds:
            box.mux(sound.encode())
    return path


def made(source: Path, output: Path, *options: str) -> list[dict[str, Any]]:
    """The streams of a preview: type, language, default flag, first and last time."""
    speed = [] if "prores" in options else ["--speed", "12"]
    assert main(["preview", str(source), str(output), *speed, "--quiet", *options]) == 0
    with av.open(str(output)) as box:
        found: list[dict[str, Any]] = [
            {"type": stream.type, "language": stream.metadata.get("language"),
             "title": stream.metadata.get("title") or stream.metadata.get("name"),
             "default": bool(int(stream.disposition) & 1)}
            for stream in box.streams
        ]  # fmt: skip
        for packet in box.demux():
            if packet.pts is not None and packet.size:
                one = found[packet.stream.index]
                time_s = float(packet.pts * packet.time_base)
                one["first"] = min(time_s, one.get("first", time_s))
                one["last"] = max(time_s, one.get("last", time_s))
    return found


TRACKS = [{"language": "fre", "title": "Commentary"}, {"language": "eng"}]


@pytest.mark.parametrize("name", ["a.mp4", "a.mkv"])
def test_languages_titles_and_the_default_flag_are_kept(tmp_path: Path, name: str) -> None:
    source = write_clip(tmp_path / "source.mkv", TRACKS, default=1)
    _, first, second = made(source, tmp_path / name)
    assert (first["language"], second["language"]) == ("fre", "eng")
    assert (first["default"], second["default"]) == (False, True)
    if name == "a.mkv":
        assert first["title"] == "Commentary"


def test_no_audio(tmp_path: Path) -> None:
    source = write_clip(tmp_path / "source.mkv", TRACKS)
    assert [s["type"] for s in made(source, tmp_path / "a.mp4", "--no-audio")] == ["video"]


def test_a_capture_that_begins_late_is_a_film_that_begins_at_once(tmp_path: Path) -> None:
    source = write_clip(tmp_path / "source.ts", TRACKS[:1], start_s=40000)
    for name in ("a.mp4", "a.mkv"):
        video, sound = made(source, tmp_path / name)
        assert video["first"] == pytest.approx(0, abs=0.05)
        assert sound["first"] == pytest.approx(0, abs=0.05)
        assert video["last"] == pytest.approx(11 / 24, abs=0.05)


def test_sound_from_0_before_a_later_picture_is_kept(tmp_path: Path) -> None:
    """PCM has no priming, which would let the sound begin before 0."""
    source = tmp_path / "source.mov"
    with av.open(str(source), "w") as box:
        video, sound = box.add_stream("mpeg4", rate=24), box.add_stream("pcm_s16le", rate=48000)
        video.width, video.height, video.pix_fmt = 64, 48, "yuv420p"
        for n in range(12):
            frame = av.VideoFrame.from_ndarray(np.full((48, 64, 3), 20 * n, np.uint8), "rgb24")
            frame = frame.reformat(format="yuv420p", threads=1)
            frame.pts, frame.time_base = n + 12, Fraction(1, 24)
            box.mux(video.encode(frame))
        for n in range(24):
            tone = av.AudioFrame.from_ndarray(np.ones((1, 2000), np.int16), "s16", "mono")
            tone.sample_rate, tone.pts = 48000, 2000 * n
            box.mux(sound.encode(tone))
        for stream in (video, sound):
            box.mux(stream.encode())
    with av.open(str(source)) as box:
        assert (box.streams.audio[0].start_time, box.streams.video[0].start_time) == (0, 6144)
    made(source, tmp_path / "a.mov", "--codec", "prores")
    with av.open(str(tmp_path / "a.mov")) as box:
        samples = sum(frame.samples for frame in box.decode(audio=0))
        assert samples == 48000, "half a second, before the picture, is lost"
        box.seek(0)
        assert next(box.decode(video=0)).time == pytest.approx(0.5, abs=0.001)


def test_joined_captures_are_one_film(tmp_path: Path) -> None:
    early = write_clip(tmp_path / "early.ts", TRACKS[:1]).read_bytes()
    late = write_clip(tmp_path / "late.ts", TRACKS[:1], start_s=40000).read_bytes()
    (tmp_path / "joined.ts").write_bytes(late + early)
    video, sound = made(tmp_path / "joined.ts", tmp_path / "a.mp4")
    assert video["last"] == pytest.approx(23 / 24, abs=0.01)
    assert sound["last"] == pytest.approx(0.98, abs=0.1)


# ---- files of ../shared ----


def report(name: str) -> Path:
    path = REPORTS / name
    if not path.exists():
        pytest.skip(f"needs ../shared: {path.name}")
    return path


@pytest.mark.parametrize(("name", "length_s"), [("ts_off.ts", 2.04), ("concat_back.ts", 4.04)])
def test_05_times_of_captures(tmp_path: Path, name: str, length_s: float) -> None:
    source = report(f"05_preview_broadcast_times/{name}")
    video, sound = made(source, tmp_path / "a.mp4")
    assert min(video["first"], sound["first"]) == pytest.approx(0, abs=0.03)
    assert max(video["last"], sound["last"]) == pytest.approx(length_s, abs=0.06)


def test_13_unknown_sound_is_left_out_and_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = report("13_unknown_audio/iphone_apac.mov")
    command = ["preview", str(source), str(tmp_path / "a.mp4"), "--speed", "12", "--json"]
    assert main(command) == 0
    events = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert any("left out" in event.get("message", "") for event in events)
    with av.open(str(tmp_path / "a.mp4")) as box:
        assert [stream.type for stream in box.streams] == ["video", "audio"]


def test_14_the_second_track_stays_the_default(tmp_path: Path) -> None:
    """The first one's language is not in the file (mdhd says 32767: unspecified)."""
    _, first, second = made(report("14_audio_tags/two_audio.mov"), tmp_path / "a.mov",
                            "--codec", "prores")  # fmt: skip
    assert (first["default"], second["default"]) == (False, True)
    assert second["language"] == "eng"
    assert (first["title"], second["title"]) == ("Directors", "Main")


@pytest.mark.parametrize(("folder", "name", "count"), [
    ("from1", "a.%04d.png", 8), ("from1001", "shot.%04d.png", 9),
])  # fmt: skip
def test_04_sequences_have_our_rate_and_numbers(
    tmp_path: Path, folder: str, name: str, count: int
) -> None:
    pattern = report(f"04_preview_of_sequence/{folder}") / name
    (video,) = made(pattern, tmp_path / "a.mp4")
    assert video["last"] == pytest.approx((count - 1) / 24, abs=1e-3)
    (video,) = made(pattern, tmp_path / "b.mp4", "--fps", "12")
    assert video["last"] == pytest.approx((count - 1) / 12, abs=1e-3)
