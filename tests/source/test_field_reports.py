"""Kinds of input that people reported elsewhere as coming out wrong, by their files in ../shared.

Values are those of ../shared/data/field_reports/README.md, of linear light, 1.0 = SDR white.
"""

from __future__ import annotations

import json
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from clips import SHARED
from stills import encoded, linear_srgb, noise

from itmo_video.cli.main import main
from itmo_video.colour import linear_light
from itmo_video.errors import AlreadyHdrError, InputError, UsageError
from itmo_video.evaluation.folders import read_rgb
from itmo_video.output.exr import read_exr
from itmo_video.source.opening import open_clip
from itmo_video.source.tags import InputOptions

REPORTS = SHARED / "data/field_reports"


def report(name: str) -> Path:
    path = REPORTS / name
    if not path.exists():
        pytest.skip(f"needs ../shared: {path.name}")
    return path


def test_01_heif_grids_are_whole() -> None:
    info = open_clip(report("01_heif_grid/arrow.heic")).info
    assert info.display_size == (3024, 4032)
    assert (info.encoding.primaries, info.encoding.transfer) == ("p3d65", "srgb")
    assert open_clip(report("01_heif_grid/sofa_grid1x5_420.avif")).info.display_size == (1024, 770)


def test_02_tiled_tiffs_are_neither_black_nor_green() -> None:
    left = linear_srgb(report("02_tiff_black_green/tiled_made.tif"))[48, 16]
    assert left == pytest.approx((0.5776,) * 3, abs=2e-4)
    checker = linear_srgb(report("02_tiff_black_green/checker.tx"))
    assert checker.mean() == pytest.approx(0.5, abs=0.02)


def test_02_jpeg_in_tiff_is_what_its_tags_say() -> None:
    """Its codes are 200, 200, 200 of Y, Cb and Cr by its TIFF tags and its JPEG header alike.

    libtiff, Pillow, imagecodecs and OpenImageIO agree on 255, 124, 255. The program that made it
    meant grey and stored RGB under a tag that says Y'CbCr.
    """
    left = linear_srgb(report("02_tiff_black_green/jpeg_made.tif"))[48, 16]
    assert left == pytest.approx((1, 0.202, 1), abs=2e-3)


def test_03_avif_keeps_alpha_and_all_frames() -> None:
    assert open_clip(
        report("03_heif_alpha_animation/avif_transparency.avif")
    ).info.encoding.has_alpha
    clip = open_clip(report("03_heif_alpha_animation/colors-animated-8bpc.avif"))
    assert [frame.index for frame in clip.frames()] == list(range(5))
    assert clip.info.frame_rate == 30


@pytest.mark.parametrize(("name", "patch", "want"), [
    ("adobergb.jpg", 5, (0.738, 0.191, 0.098)), ("p3.png", 5, (0.665, 0.171, 0.087)),
    ("linear.tif", None, (0.503,) * 3),
])  # fmt: skip
def test_06_icc_profiles_are_applied(name: str, patch: int | None, want: tuple[float, ...]) -> None:
    rgb = linear_srgb(report(f"06_icc_ignored/{name}"))
    seen = rgb[::8, ::8].reshape(-1, 3)
    assert np.abs(seen - want).max(axis=1).min() < 0.004, "the patch is nowhere"


def test_09_truncated_jpeg_is_refused() -> None:
    with pytest.raises(InputError, match="truncated"):
        open_clip(report("09_truncated_jpeg/cut_full.jpg"))


def test_16_log_dpx_is_refused_as_hdr() -> None:
    with pytest.raises(AlreadyHdrError, match="logarithmic"):
        open_clip(report("16_log_dpx/log_tagged.dpx"))


def test_17_associated_alpha_is_not_multiplied_twice() -> None:
    for name in ("assoc_alpha.tif", "unassoc_alpha.tif"):
        frame = next(iter(open_clip(report(f"17_tiff_assoc_alpha_cmyk/{name}")).frames()))
        top = 2.0**frame.encoding.bit_depth - 1
        half = np.isclose(frame.planes[3] / top, 128 / 255, atol=0.01)
        assert half.any()
        if name == "assoc_alpha.tif":
            assert frame.planes[0][half].max() / top == pytest.approx(1, abs=0.01)


def test_20_small_kinds() -> None:
    clip = open_clip(report("20_small/animated.webp"))
    assert clip.info.frames == len(list(clip.frames())) == 42
    assert clip.info.duration_s == Fraction(283, 100)
    assert open_clip(report("20_small/xmp_no_prefix.jpg")).info.display_size == (1, 1)


def test_07_untagged_hd_that_was_cropped_is_709() -> None:
    encoding = open_clip(report("07_cropped_720p_untagged/crop720p_untagged.mp4")).info.encoding
    assert (encoding.matrix, encoding.origins["matrix"]) == ("bt709", "assumed")


def test_08_dolby_vision_of_no_other_player_is_hdr() -> None:
    path = report("08_dolby_vision_p5/dolby_vision_p5.mp4")
    with pytest.raises(AlreadyHdrError, match="profile 5"):
        open_clip(path)
    assert open_clip(path, InputOptions(force_sdr=True)).info.frames == 12


def test_10_white_of_15_bits_is_white() -> None:
    rgb = linear_srgb(report("10_rgb555/white_rgb555le.avi"))
    assert rgb.min() == pytest.approx(1, abs=1e-6)


def test_11_empty_chunks_repeat_the_frame_before() -> None:
    clip = open_clip(report("11_avi_null_frames/null_mjpeg.avi"))
    frames = {frame.index: frame for frame in clip.frames()}
    assert list(frames) == list(range(25))
    assert clip.info.frames_declared == 25
    for index, source in ((5, 4), (6, 4), (12, 11)):
        assert np.array_equal(frames[index].planes[0], frames[source].planes[0])
        (again, *_) = clip.frames(index)
        assert again.index == index
        assert np.array_equal(again.planes[0], frames[source].planes[0])


def test_12_the_default_stream_is_read_and_told() -> None:
    path = report("12_several_video_streams/two_videos.mkv")
    info = open_clip(path).info
    assert info.display_size == (640, 360)
    assert any("--stream" in notice for notice in info.notices)
    assert open_clip(path, InputOptions(stream=0)).info.display_size == (160, 96)
    with pytest.raises(UsageError, match="not a video stream"):
        open_clip(path, InputOptions(stream=7))


def test_15_a_sequence_lasts_as_long_as_its_clip() -> None:
    film = open_clip(report("15_frames_per_second/soft_telecine.mpg")).info
    assert film.frame_rate == Fraction(24000, 1001)
    frames = list(open_clip(report("15_frames_per_second/soft_telecine.mpg")).frames())
    assert len(frames) == 60
    assert not any(frame.is_damaged for frame in frames)
    screen = open_clip(report("15_frames_per_second/screen_vfr.mkv")).info
    assert float(screen.frame_rate) == pytest.approx(26.97, abs=0.005)
    assert screen.frames / screen.frame_rate == screen.duration_s
    assert any("--fps" in notice for notice in screen.notices)


def test_18_info_says_pq_as_tagged(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", "--json", str(report("18_info_hdr/dovi_regular.mkv"))]) == 0
    assert json.loads(capsys.readouterr().out)["transfer"] == {"value": "pq", "from": "tag"}


def test_19_crops_of_containers_are_applied() -> None:
    clip = open_clip(report("19_container_crop/mkv_pixelcrop.mkv"))
    assert clip.info.display_size == (320, 160)
    frame = next(iter(clip.frames()))
    assert frame.size == (320, 160)
    assert np.dstack(linear_light.to_rgb_linear(frame, clip=True)).min() > 0.1, "black lines"


def test_20_timecode_above_30_a_second_is_on_no_frame_and_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = report("20_small/tc_df60.mov")
    assert main(["convert", str(source), str(tmp_path), "--strength", "0"]) == 0
    assert "01:00:59;56" in capsys.readouterr().err
    codes = [read_exr(path).attributes.get("timeCode") for path in sorted(tmp_path.glob("*.exr"))]
    assert codes == [None] * 12


def test_20_a_truth_in_a_data_window_is_placed() -> None:
    path = report("20_small/autocropped_truth/ev.0001.exr")
    rgb = read_rgb(path)
    assert rgb.shape == (120, 200, 3)
    assert not rgb[:12].any()
    assert rgb[12:108, 20:180].any()


def test_09_a_truncated_image_of_a_sequence_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = [encoded(noise(48, 64, seed=n), "JPEG") for n in range(3)]
    for n, image in enumerate(data):
        (tmp_path / f"s.{n}.jpg").write_bytes(image[: len(image) // 2] if n == 1 else image)
    assert main(["convert", str(tmp_path / "s.%d.jpg"), str(tmp_path / "out"), "--quiet"]) == 4
    told = capsys.readouterr().err
    assert "frame 1 is missing or cannot be decoded (s.1.jpg: it is truncated" in told
    assert len(list((tmp_path / "out").glob("*.exr"))) == 2


def test_01_a_grid_that_was_cut_is_refused(tmp_path: Path) -> None:
    for name in ("arrow.heic", "sofa_grid1x5_420.avif"):
        data = report(f"01_heif_grid/{name}").read_bytes()
        for part in (0.13, 0.6, 0.97):
            (tmp_path / name).write_bytes(data[: int(len(data) * part)])
            with pytest.raises(InputError, match="cannot be decoded"):
                open_clip(tmp_path / name)
