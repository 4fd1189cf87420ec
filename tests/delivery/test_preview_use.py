"""Previews in use: stills, wrong use, and pictures that come in order or fail."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Generator
from pathlib import Path

import av
import numpy as np
import pytest
from stills import bgr_codes

from itmo_video import make_settings
from itmo_video.cli.main import main
from itmo_video.conversion.run_options import RunOptions
from itmo_video.delivery import from_clip, pictures, sdr
from itmo_video.delivery.in_order import Closed, InOrder, run_in_order
from itmo_video.errors import UsageError


def test_stills(scene: Path, tmp_path: Path) -> None:
    def make(name: str, *more: str) -> Path:
        path = tmp_path / name
        assert main(["preview", str(scene), str(path), "--frame", "3", "--quiet", *more]) == 0
        return path

    png = make("a.png").read_bytes()
    at = png.index(b"cICP")
    assert png[at + 4 : at + 8] == bytes((9, 16, 0, 1)), "not tagged as PQ BT.2020"
    assert png[at + 8 : at + 12] == struct.pack(">I", zlib.crc32(png[at : at + 8])), "bad CRC"
    assert at < png.index(b"IDAT"), "cICP must come first"
    assert bgr_codes(tmp_path / "a.png").dtype == np.uint16
    with av.open(str(make("a.avif", "--crf", "1"))) as box:
        frame = next(box.decode(video=0))
    assert frame.format.name == "yuv420p10le", "AVIF is not 10 bit"
    assert (int(frame.color_primaries), int(frame.color_trc)) == (9, 16), "AVIF is not tagged PQ"
    for view, size in (("sdr", (128, 192)), ("compare", (128, 384)), ("ladder", (64, 288))):
        assert bgr_codes(make(f"{view}.jpg", "--as", view)).shape[:2] == size, view
    legend = bgr_codes(make("false.jpg", "--as", "false-colour", "--scale", "nits"))
    assert legend.shape[0] > 128, "no legend below false colour"


@pytest.mark.parametrize("name", sorted(sdr.TONE_MAPS))
def test_tone_maps_rise_and_stay_in_sdr(name: str) -> None:
    level = np.geomspace(1e-3, 5, 200).astype(np.float32)
    out = sdr.tone_mapped(np.dstack([level[None]] * 3), name, 5.0)[0, :, 0]
    # The factor is looked up by a half float, whose own step is 5e-4.
    assert (np.diff(out) >= -5e-4).all(), f"{name} is not monotonic"
    assert out.max() <= 1
    assert out[-1] > 0.9, f"{name} does not bring the peak to white"


@pytest.mark.parametrize(
    ("output", "options"),
    [
        ("x.avi", []),
        ("x.mov", []),
        ("x.mp4", ["--codec", "prores"]),
        ("x.mp4", ["--chroma", "422"]),
        ("x.jpg", []),
        ("x.mp4", ["--frame", "1"]),
        ("x.jpg", ["--frame", "1", "--as", "hlg"]),
        ("x.mp4", ["--crf", "99"]),
    ],
)
def test_wrong_use_is_told(scene: Path, tmp_path: Path, output: str, options: list[str]) -> None:
    assert main(["preview", str(scene), str(tmp_path / output), *options]) == UsageError.exit_code
    assert not list(tmp_path.iterdir()), "something was left behind"


def test_high_quality_is_asked_for_by_a_word(scene: Path, tmp_path: Path) -> None:
    made = []
    for quality in ("high", "1"):
        film = tmp_path / f"{quality}.mp4"
        flags = ["--quality", quality, "--frames", "1-2", "--quiet"]
        assert main(["preview", str(scene), str(film), *flags]) == 0
        made.append(film.stat().st_size)
    assert made[0] == made[1], "high is CRF 1"
    assert main(["preview", str(scene), str(tmp_path / "no.mp4"), "--quality", "best"]) == 2


def test_a_failing_picture_ends_the_preview(scene: Path, tmp_path: Path) -> None:
    """No thread waits for a frame that will never come."""
    source = from_clip.from_clip(scene, make_settings(), RunOptions(jobs=3))

    def work(picture: pictures.Picture) -> int:
        if picture.index == 2:
            raise ZeroDivisionError
        return picture.index

    with pytest.raises(ZeroDivisionError):
        list(source.mapped(work))


def test_frames_come_in_order_whatever_the_threads_do() -> None:
    def make(buffer: InOrder[int]) -> None:
        buffer.plan([3, 5, 7])
        for index in (5, 7, 3):
            buffer.put(index, index * 10)

    assert list(run_in_order(make, 3)) == [30, 50, 70]
    stopped = run_in_order(make, 1 << 20)
    assert next(stopped) == 30
    assert isinstance(stopped, Generator)
    stopped.close()


def test_put_tells_that_the_reader_left() -> None:
    buffer: InOrder[int] = InOrder(1)
    buffer.plan([0, 1])
    buffer.close()
    with pytest.raises(Closed):
        buffer.put(1, 1)
