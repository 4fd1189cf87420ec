"""Rates and lengths of sources whose last frame is shown longer or shorter than the others."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
from PIL import Image

from itmo_video import RunOptions, Settings, open_clip, preview
from itmo_video.source.frame_timing import timing
from itmo_video.source.packets import Packets
from itmo_video.source.tags import InputOptions

FILM = Fraction(24000, 1001)


def write_mp4(path: Path, stamps: list[int], last: int, rate: Fraction, base: Fraction) -> Path:
    """An MP4 of grey frames at these stamps, the last one shown for `last` ticks of `base`."""
    with av.open(str(path), "w") as box:
        stream = box.add_stream("mpeg4", rate=rate)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        stream.time_base = stream.codec_context.time_base = base
        packets = []
        for n, stamp in enumerate(stamps):
            codes = np.full((48, 64), (40 + 9 * n) % 256, np.uint8)
            frame = av.VideoFrame.from_ndarray(codes, "gray").reformat(format="yuv420p")
            frame.pts, frame.time_base = stamp, base
            packets += stream.encode(frame)
        for packet in [*packets, *stream.encode()]:
            packet.duration = last if packet.pts == stamps[-1] else 0
            box.mux(packet)
    return path


@pytest.mark.parametrize("last", [977, 1001, 1200])
def test_a_last_frame_of_another_length_leaves_the_rate(tmp_path: Path, last: int) -> None:
    stamps = [1001 * n for n in range(12)]
    path = write_mp4(tmp_path / "a.mp4", stamps, last, FILM, Fraction(1, 24000))
    with av.open(str(path)) as box:
        assert (box.streams.video[0].average_rate == FILM) == (last == 1001)
    with open_clip(path) as clip:
        assert (clip.info.frame_rate, clip.info.is_vfr) == (FILM, False)


def test_stamps_in_milliseconds_leave_a_stated_rate() -> None:
    class Stream:
        average_rate = base_rate = guessed_rate = Fraction(30)

    for count in (2, 3, 30):
        stamps = tuple(round(1000 * n / 30) for n in range(count))
        packets = Packets(stamps, {}, (), is_exact=True)
        assert timing(Stream(), Fraction(30), packets, Fraction(1, 1000))[0] == 30


def test_the_last_frame_of_a_varying_rate_has_its_own_time(tmp_path: Path) -> None:
    base = Fraction(1, 12800)
    stamps = [0, 512, 1024, 3584, 4096, 4608, 5120, 5632]
    path = write_mp4(tmp_path / "gap.mp4", stamps, 512, Fraction(25), base)
    with open_clip(path, InputOptions(fps=Fraction(25))) as clip:
        assert clip.info.frames == 12
    film = tmp_path / "shown.mp4"
    preview(path, film, Settings(), RunOptions(jobs=1))
    with av.open(str(film)) as box:
        stream = box.streams.video[0]
        assert stream.duration is not None
        assert stream.time_base is not None
        assert stream.duration * stream.time_base == Fraction(12, 25)


def test_the_last_frame_of_an_animation_has_its_own_time(tmp_path: Path) -> None:
    pictures = [Image.new("P", (32, 24), n) for n in range(4)]
    for n, picture in enumerate(pictures):
        picture.putpalette([60 * n, 80, 90] * 4)
    path = tmp_path / "a.gif"
    pictures[0].save(path, save_all=True, append_images=pictures[1:], duration=[50, 100, 100, 200])
    with open_clip(path, InputOptions(fps=Fraction(20))) as clip:
        assert clip.info.frames == 9


@pytest.mark.parametrize("rate", [Fraction(24), FILM, Fraction(30000, 1001), Fraction(60)])
def test_a_constant_rate_survives_a_remux_from_milliseconds(tmp_path: Path, rate: Fraction) -> None:
    """Matroska rounds stamps to milliseconds; MP4 keeps them, in a finer time base."""
    base = Fraction(1, 16000)
    stamps = [16 * round(1000 * n / rate) for n in range(40)]
    path = write_mp4(tmp_path / "a.mp4", stamps, round(16000 / rate), rate, base)
    with open_clip(path) as clip:
        assert (clip.info.frame_rate, clip.info.is_vfr) == (rate, False)
        assert not any("variable" in notice for notice in clip.info.notices)


def test_one_frame_that_is_late_makes_the_rate_vary(tmp_path: Path) -> None:
    stamps = [16 * (round(1000 * n / 24) + (4 if n == 20 else 0)) for n in range(60)]
    path = write_mp4(tmp_path / "a.mp4", stamps, 666, Fraction(24), Fraction(1, 16000))
    with open_clip(path) as clip:
        assert clip.info.is_vfr
