"""Previews keep a source's times, sound, chapters and shape of pixels."""

from __future__ import annotations

from contextlib import closing
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from av.stream import Stream
from clips import moving_scene, write_film

from itmo_video import make_settings
from itmo_video.delivery.choices import Codec
from itmo_video.delivery.film_spec import FilmSpec
from itmo_video.delivery.film_writer import FilmWriter
from itmo_video.delivery.preview import preview
from itmo_video.delivery.preview_options import PreviewOptions
from itmo_video.errors import UsageError
from itmo_video.output.gate import FILM, Gate


def length_s(stream: Stream) -> float:
    assert stream.duration is not None
    assert stream.time_base is not None
    return float(stream.duration * stream.time_base)


def seconds(ticks: int | None, base: Fraction | None) -> Fraction:
    assert ticks is not None
    assert base is not None
    return ticks * base


def test_sound_stays_in_step(tmp_path: Path) -> None:
    source = write_film(tmp_path / "loud.mp4", moving_scene(50), sound=("aac", "ac3"))
    film = tmp_path / "film.mp4"
    # The operator does not matter; without a map it is quick.
    preview(source, film, make_settings(expand_map=False), options=PreviewOptions(speed="12"))
    with av.open(str(source)) as was, av.open(str(film)) as is_:
        assert len(is_.streams.audio) == len(was.streams.audio), "a sound track is lost"
        rate = was.streams.video[0].average_rate
        assert rate is not None
        assert len(was.streams.audio) == 2
        pairs = list(zip(was.streams.audio, is_.streams.audio, strict=True))
        for old, new in [(was.streams.video[0], is_.streams.video[0]), *pairs]:
            assert length_s(new) == pytest.approx(length_s(old), abs=float(1 / rate)), new.type
            assert new.type != "audio" or new.codec.name == old.codec.name
        first = [next(box.demux(box.streams.audio[0])).pts for box in (was, is_)]
        assert first[0] == first[1], "sound is shifted"


def test_variable_frame_rate_keeps_its_time_stamps(tmp_path: Path) -> None:
    stamps = [0, 512, 1024, 3000, 3100, 6000, 6512, 9001]
    clip = tmp_path / "vfr.mp4"
    with av.open(str(clip), "w") as box:
        stream: Any = box.add_stream("libx264", rate=25, options={"bf": "0"})
        stream.width, stream.height, stream.pix_fmt = 97, 65, "yuv444p"
        stream.codec_context.time_base = Fraction(1, 12800)
        for i, pts in enumerate(stamps):
            frame = av.VideoFrame.from_ndarray(np.full((65, 97, 3), 20 * i, np.uint8), "rgb24")
            frame.pts, frame.time_base = pts, Fraction(1, 12800)
            box.mux(stream.encode(frame))
        box.mux(stream.encode())
    films: list[tuple[Codec, str]] = [("av1", ".mp4"), ("hevc", ".mp4"), ("prores", ".mov")]
    for codec, suffix in films:
        film = tmp_path / f"{codec}{suffix}"
        preview(clip, film, options=PreviewOptions(codec=codec))
        with av.open(str(film)) as box:
            assert (box.streams.video[0].width, box.streams.video[0].height) == (98, 66), "padding"
            times = [seconds(f.pts, f.time_base) for f in box.decode(video=0)]
        assert times == [Fraction(s, 12800) for s in stamps], f"{codec}: time stamps moved"


@pytest.mark.parametrize("frames", [1, 2])
def test_hevc_of_few_frames_has_times(tmp_path: Path, frames: int) -> None:
    """x265 alone gives them a decoding time by chance: one film in seven could not be written."""
    base = Fraction(1, 25)
    spec = FilmSpec(64, 48, 1 / base, base, Fraction(1), "hlg", "hevc", speed="ultrafast")
    grey = (np.full((48, 64), 512, np.uint16), *[np.full((24, 32), 512, np.uint16)] * 2)
    for number in range(12):
        path = tmp_path / f"{number}.mp4"
        with closing(FilmWriter(Gate(path, FILM), spec)) as film:
            for index in range(frames):
                film.write(grey, index * base)
            film.finish(None)
        with av.open(str(path)) as box:
            packets = [p for p in box.demux() if p.size]
        for index, p in enumerate(packets):
            assert seconds(p.pts, p.time_base) == seconds(p.dts, p.time_base) == index * base
        assert len(packets) == frames


def test_chapters_and_the_shape_of_pixels_stay(tmp_path: Path) -> None:
    clip = tmp_path / "wide.mp4"
    with av.open(str(clip), "w") as box:
        stream: Any = box.add_stream("libx264", rate=25)
        stream.width, stream.height, stream.pix_fmt = 96, 64, "yuv420p"
        stream.codec_context.sample_aspect_ratio = Fraction(4, 3)
        base = Fraction(1, 1000)
        box.set_chapters(
            [
                {"id": i, "start": 200 * i, "end": 200 * i + 200, "time_base": base,
                 "metadata": {"title": f"Part {i}"}} for i in range(2)
            ]
        )  # fmt: skip
        for i in range(10):
            frame = av.VideoFrame.from_ndarray(np.full((64, 96, 3), 20 * i, np.uint8), "rgb24")
            frame.pts, frame.time_base = i, Fraction(1, 25)
            box.mux(stream.encode(frame))
        box.mux(stream.encode())
    film = tmp_path / "film.mp4"
    preview(clip, film)
    with av.open(str(film)) as box:
        titles = [chapter["metadata"]["title"] for chapter in box.chapters()]
        assert titles == ["Part 0", "Part 1"], "chapters are lost"
        assert box.streams.video[0].sample_aspect_ratio == Fraction(4, 3), "pixels changed shape"
    with pytest.raises(UsageError):
        preview(clip, tmp_path / "film.mkv")
