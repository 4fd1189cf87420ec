"""The views of ACES 2.0: the transform's numbers reach stills and films."""

from __future__ import annotations

import sys
from pathlib import Path

import av
import numpy as np
import pytest
from clips import moving_scene, write_ffv1
from stills import bgr_codes

from itmo_video import PreviewOptions, convert, preview
from itmo_video.cli.main import main
from itmo_video.delivery import aces
from itmo_video.delivery.aces import aces_hdr_nits, aces_peak, aces_sdr
from itmo_video.errors import UsageError
from itmo_video.output.exr import read_exr

pytest.importorskip("PyOpenColorIO")


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_ffv1(tmp_path_factory.mktemp("aces") / "c.mkv", moving_scene(1))


def test_grey_stays_grey_rises_and_ends_at_the_peak() -> None:
    level = np.geomspace(1e-3, 64, 60).astype(np.float32)[None]
    shown = aces_sdr((level, level, level), "rec709")[0]
    assert np.ptp(shown, axis=1).max() < 1e-4, "grey is coloured"
    assert (np.diff(shown[:, 0]) > -1e-4).all()
    assert shown[-1, 0] == pytest.approx(1, abs=1e-2)
    nits = aces_hdr_nits((level, level, level), "rec709", 1000)[0]
    assert (np.diff(nits[:, 0]) > -0.1).all()
    assert 850 < nits[-1, 0] < 1001


def test_middle_grey_is_where_aces_2_puts_it() -> None:
    """10 nits of 100 in SDR, about 14.5 of 1000: Daniele's tone scale (ACES 2.0)."""
    grey = np.full((1, 1), 0.18, np.float32)
    sdr = 100 * float(aces_sdr((grey, grey, grey), "acescg")[0, 0, 1]) ** 2.4
    assert sdr == pytest.approx(10.0, abs=0.1)
    hdr = float(aces_hdr_nits((grey, grey, grey), "acescg", 1000)[0, 0, 1])
    assert hdr == pytest.approx(14.5, abs=0.2)


def test_a_colour_is_the_same_from_all_primaries() -> None:
    from itmo_video.colour.primaries import rgb_to_rgb_matrix

    colour = np.array([0.7, 0.2, 0.1])
    plain = aces_sdr([np.full((1, 1), v, np.float32) for v in colour], "rec709")
    for name in ("rec2020", "acescg", "aces2065-1"):
        other = rgb_to_rgb_matrix("rec709", name) @ colour
        shown = aces_sdr([np.full((1, 1), v, np.float32) for v in other], name)
        np.testing.assert_allclose(shown, plain, atol=2e-3, err_msg=name)


def test_the_still_and_the_film_are_the_transforms(clip: Path, tmp_path: Path) -> None:
    convert(clip, tmp_path / "out")
    channels = read_exr(next((tmp_path / "out").glob("*.exr"))).channels
    planes = [channels[c] for c in "RGB"]
    png = tmp_path / "a.png"
    assert main(["preview", str(clip), str(png), "--as", "aces", "--quiet"]) == 0
    codes = bgr_codes(png)[..., ::-1]
    assert np.abs(codes - 255 * aces_sdr(planes, "rec709")).max() <= 1
    dark = tmp_path / "dark.png"
    flags = ["--as", "aces", "--quiet", "--exposure", "-2"]
    assert main(["preview", str(tmp_path / "out"), str(dark), "--frame", "1", *flags]) == 0
    expected = 255 * aces_sdr(planes, "rec709", 0.25)
    assert np.abs(bgr_codes(dark)[..., ::-1] - expected).max() <= 1

    film = tmp_path / "film.mp4"
    options = PreviewOptions(view="aces-hdr", speed="10")
    done = preview(clip, film, options=options)
    nits = aces_hdr_nits(planes, "rec709", 1000)
    assert done.max_cll == pytest.approx(float(nits.max()), rel=5e-3)
    assert done.max_fall == pytest.approx(float(nits.max(axis=2).mean()), rel=5e-3)
    with av.open(str(film)) as box:
        assert int(box.streams.video[0].codec_context.color_trc) == 16


def test_the_display_is_the_brightest_that_is_no_brighter() -> None:
    assert [aces_peak(nits) for nits in (400, 600, 1000, 3999, 10000)] == [
        500, 500, 1000, 2000, 4000,
    ]  # fmt: skip


def test_without_the_extra_it_is_told(clip: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    aces._processor.cache_clear()
    monkeypatch.setitem(sys.modules, "PyOpenColorIO", None)
    with pytest.raises(UsageError, match="OpenColorIO") as caught:
        preview(clip, clip.parent / "x.mp4", options=PreviewOptions(view="aces"))
    assert "pip install '.[ocio]'" in str(caught.value)
    assert not (clip.parent / "x.mp4").exists()
    with pytest.raises(UsageError, match="to PQ only"):
        preview(clip, "x.mp4", options=PreviewOptions(view="aces-hdr", display_peak=300))
