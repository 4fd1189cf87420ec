"""--fps: constant rate from any source; all numbers then count resampled frames."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from clips import SHARED, moving_scene, write_ffv1

from itmo_video import Settings, UsageError, convert, make_settings, open_clip
from itmo_video.source.tags import InputOptions


@pytest.mark.parametrize(
    ("fps", "rate"),
    [
        ("25", Fraction(25)),
        ("23.976", Fraction(24000, 1001)),
        ("29.97", Fraction(30000, 1001)),
        ("24000/1001", Fraction(24000, 1001)),
        ("12.5", Fraction(25, 2)),
    ],
)
def test_rates_as_people_write_them(fps: str, rate: Fraction) -> None:
    assert Settings(fps=fps).frame_rate == rate


@pytest.mark.parametrize("fps", ["0", "-5", "x", "1/0", "99999"])
def test_no_rate_is_refused(fps: str) -> None:
    with pytest.raises(UsageError, match="fps must be"):
        Settings(fps=fps)


def test_frames_are_dropped_and_repeated_by_time(tmp_path: Path) -> None:
    clip = write_ffv1(tmp_path / "c.mkv", moving_scene(24), fps=24)
    with open_clip(clip) as source:
        pictures = [f.planes[0] for f in source.frames()]
    for fps, expected in ((12, list(range(0, 24, 2))), (48, [i // 2 for i in range(48)])):
        with open_clip(clip, InputOptions(fps=Fraction(fps))) as resampled:
            assert resampled.info.frames == len(expected)
            got = list(resampled.frames())
            assert [f.index for f in got] == list(range(len(expected)))
            for frame, source_index in zip(got, expected, strict=True):
                assert (frame.planes[0] == pictures[source_index]).all(), (fps, frame.index)
            for start in (1, 5, len(expected) - 1):
                later = list(resampled.frames(start))
                assert [f.index for f in later] == list(range(start, len(expected)))
                assert (later[0].planes[0] == got[start].planes[0]).all()


@pytest.mark.shared
def test_a_variable_rate_becomes_constant(tmp_path: Path) -> None:
    clip = SHARED / "data/odd_clips/vfr_h264.mp4"
    with open_clip(clip) as source:
        times = [float(source.time_s(i)) for i in range(source.info.frames)]
    summary = convert(clip, tmp_path / "o", make_settings(fps="25", compression="none"))
    length = times[-1] - times[0]
    assert abs(summary.written / 25 - length) < np.diff(times).max() + 0.04


def test_mixed_telecine_is_told(tmp_path: Path) -> None:
    """MPEG-2 frames of which every third is coded interlaced, as telecined film is."""
    import av

    from itmo_video.source.stream_facts import mixture

    path = tmp_path / "film.mkv"
    with av.open(str(path), "w") as box:
        stream = box.add_stream("mpeg2video", rate=24)
        stream.width, stream.height, stream.pix_fmt = 96, 64, "yuv420p"
        for n, rgb in enumerate(moving_scene(12)):
            frame = av.VideoFrame.from_ndarray(rgb, "rgb24").reformat(format="yuv420p")
            frame.pts = n
            box.mux(stream.encode(frame))
        box.mux(stream.encode())
    with open_clip(path) as clip:
        assert not any("telecine" in notice for notice in clip.info.notices)
    (told,) = mixture([n % 3 == 0 for n in range(12)])
    assert told.startswith("4 of the first 12 frames are interlaced")
