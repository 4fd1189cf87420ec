"""The operator `auto`: its input, its gate, its network's laws, and truth on scenes held out."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from clips import SHARED, write_ffv1
from hypothesis import given
from hypothesis import strategies as st

from itmo_video import convert, make_settings
from itmo_video.evaluation.fidelity import pq_psnr_db
from itmo_video.model import Float32
from itmo_video.operators import auto, auto_clipping, auto_levels, auto_rendering
from itmo_video.operators.base import Context
from itmo_video.output.exr import read_exr

PEAK = 1000 / 203
BT709 = np.array([0.2126, 0.7152, 0.0722])
DISPLAY = Context(PEAK, PEAK)


def slow_features(codes: np.ndarray, height: int) -> np.ndarray:
    """The network's input pixel by pixel."""
    h, w = codes.shape[0] // 2, codes.shape[1] // 2
    out = np.zeros((17, h, w))
    for y in range(h):
        for x in range(w):
            for dy in range(2):
                for dx in range(2):
                    pixel = codes[2 * y + dy, 2 * x + dx].astype(np.float64)
                    for c in range(3):
                        out[c * 4 + dy * 2 + dx, y, x] = pixel[c] - 0.5
                    gate = 1 / (1 + math.exp(-40 * (pixel.max() - 0.9)))
                    out[12 + dy * 2 + dx, y, x] = gate * (1 + math.exp(-4))
            out[16, y, x] = -1 + 2 * y / (height / 2 - 1)
    return out


def lamps(height: int = 96, width: int = 160) -> np.ndarray:
    """A dark, noisy room with two clipped lamps: linear RGB in [0, 1]."""
    rng = np.random.default_rng(5)
    y, x = np.mgrid[0:height, 0:width]
    light = 0.04 + 0.01 * rng.random((height, width))
    for cy, cx, r in ((30, 40, 5), (60, 110, 9)):
        light += 3 * np.exp(-(((y - cy) ** 2 + (x - cx) ** 2) / (2 * r * r)))
    return np.clip(light[..., None] * (1, 0.9, 0.75), 0, 1).astype(np.float32)


def test_features_equal_the_slow_ones() -> None:
    codes = np.random.default_rng(0).random((6, 8, 3), np.float32)
    assert np.allclose(auto_levels.features(codes, 5), slow_features(codes, 5), atol=1e-5)


def test_srgb_codes_at_published_values() -> None:
    light = np.array([[[0.0, 0.0031308, 0.21404114], [0.5, 0.73791, 1.0]]], np.float32)
    want = [[[0.0, 0.0404499, 0.5], [0.7353569, 0.8745, 1.0]]]
    assert np.allclose(auto_levels.srgb_codes(light), want, atol=2e-4)


def gain_of(
    rgb: npt.ArrayLike,
    maps: npt.ArrayLike = (),
    context: Context = DISPLAY,
    ratio: Float32 | None = None,
) -> Float32:
    """gain_auto of pixels (n, 3) among their like, maps (n, 4): (n, 3)."""
    planes, parts = (
        [np.repeat(np.asarray(part, np.float32)[None], 3, 1) for part in np.asarray(values).T]
        for values in (rgb, maps)
    )
    return np.stack([gain[0, 1::3] for gain in auto.gain_auto(planes, ratio, parts, context)], 1)


@given(st.floats(0, 1), st.floats(0, 1), st.floats(0, 1), st.floats(0, 1), st.floats(1, 100))
def test_gain_of_grey_rises_and_never_passes_the_peak(
    low: float, high: float, level: float, curve: float, l_max: float
) -> None:
    low, high = sorted((low, high))
    rgb = np.array([[low] * 3, [high] * 3, [1.0] * 3, [0.0] * 3], np.float32)
    maps = np.tile([level, level, level, curve], (4, 1))
    light = rgb * gain_of(rgb, maps, Context(l_max, l_max))
    assert light[0, 0] <= light[1, 0] * (1 + 1e-5)
    assert light.max() <= l_max * (1 + 1e-5)
    assert light[2, 0] >= l_max**level * (1 - 1e-4)
    assert light[3, 0] == 0


def test_eq_11_where_the_weight_is_one() -> None:
    grey = np.linspace(0.01, 1, 50)
    maps = np.tile([0, 0, 0, 1 / auto_rendering.GREATEST_WEIGHT], (50, 1))
    light = grey * gain_of(np.tile(grey[:, None], (1, 3)), maps)[:, 0]
    root = np.sqrt((1 - grey) ** 2 + 4 * grey / PEAK**2)
    assert np.allclose(light, PEAK**2 / 2 * (grey - 1 + root), rtol=1e-4)


@given(st.lists(st.floats(0, 0.9), min_size=3, max_size=3), st.floats(0, 1), st.floats(0, 1))
def test_what_did_not_clip_keeps_its_chromaticity(
    pixel: list[float], level: float, curve: float
) -> None:
    gain = gain_of([pixel], [[level, 0.5 * level, 0.2, curve]])[0]
    assert gain.max() <= gain.min() * (1 + 1e-5)


@given(st.lists(st.floats(0, 1), min_size=3, max_size=3), st.floats(0, 1), st.floats(0, 1))
def test_the_camera_s_hue_is_kept_where_that_is_asked(
    pixel: list[float], level: float, curve: float
) -> None:
    keep = Context(PEAK, PEAK, hue="keep")
    gain = gain_of([pixel], [[level, 0.5 * level, 0.2, curve]], keep)[0]
    assert gain.max() <= gain.min() * (1 + 1e-5)


def test_a_map_of_zero_changes_nothing() -> None:
    rgb = np.random.default_rng(0).random((64, 3))
    assert (gain_of(rgb, np.zeros((64, 4))) == 1).all()


def shot(shoulder: bool) -> np.ndarray:
    """A scene up to 8 times white as a camera clips it, or under Reinhard's curve: (H, W, 3)."""
    rng = np.random.default_rng(2)
    light = np.exp2(rng.uniform(-5, 3, (30, 40))).astype(np.float32)
    light = cv2.resize(light, (160, 120), interpolation=cv2.INTER_CUBIC).clip(0.01, 8)
    light = light * (1 + light / 64) / (1 + light) if shoulder else np.minimum(light, 1)
    return np.dstack([light] * 3).astype(np.float32)


def test_a_shoulder_is_told_from_clipping() -> None:
    clipped, folded = (auto_rendering.rendering_of(shot(s)) for s in (False, True))
    assert clipped.tone_mapped == 0
    assert folded.tone_mapped == 1 or folded.white < auto_rendering.WHITE_FULL
    assert "camera" in clipped.in_words(PEAK)


def test_few_clipped_pixels_are_not_called_nothing() -> None:
    picture = np.full((64, 64, 3), 0.4, np.float32)
    assert "nothing reaches white" in auto_rendering.rendering_of(picture).in_words(PEAK)
    picture[20, 20] = 1
    assert "hardly anything clips" in auto_rendering.rendering_of(picture).in_words(PEAK)


def test_what_clipped_alone_on_a_wall_is_no_lamp() -> None:
    wall = np.full((64, 64, 3), (0.9, 0.6, 0.45), np.float32)
    wall[20, 20, 0] = 1
    assert auto_clipping.known_clipped(wall).max() == 0
    wall[40:48, 40:48, 0] = 1
    known = auto_clipping.known_clipped(wall)
    assert known[43, 43, 0] > 0.99
    assert known[..., 1:].max() == 0


def test_lamps_in_the_dark_are_found_and_a_wall_is_none() -> None:
    picture = np.full((120, 200), 0.03, np.float32)
    picture[50:53, 80:83] = 0.6
    picture[:, 150:] = 0.7
    found = auto_rendering.small_lights(picture)
    assert found[51, 81] > 0.9
    assert found[:, 160:].max() == 0


def test_a_channel_that_does_not_clip_stays_as_it_was_recorded(tmp_path: Path) -> None:
    """A blue sky whose blue clips: red and green are known, and blue may only rise."""
    y = np.linspace(0, 1, 96)[:, None, None]
    sky = np.broadcast_to(np.array([0.16, 0.45, 1.0]) * (1 - 0.1 * y), (96, 160, 3))
    codes = np.rint(255 * auto_levels.srgb_codes(np.minimum(sky, 1).astype(np.float32))).astype(
        np.uint8
    )
    convert(
        write_ffv1(tmp_path / "sky.mkv", [codes]),
        tmp_path / "out",
        make_settings(transfer="srgb", noise_guard=False),
    )
    rgb = read_exr(next((tmp_path / "out").glob("*.exr"))).channels
    code = codes.astype(np.float64) / 255
    recorded = np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)
    for i, name in enumerate("RG"):
        assert np.allclose(rgb[name], recorded[..., i], rtol=2e-3), name
    assert (rgb["B"] >= recorded[..., 2] * (1 - 2e-3)).all()


@pytest.mark.parametrize("size", [(1, 1), (3, 7), (31, 33), (64, 64), (90, 51)])
def test_map_of_any_size_lies_in_its_range(size: tuple[int, int]) -> None:
    rgb = np.random.default_rng(1).random((*size, 3), np.float32)
    for l_max in (1.0, 2.0, PEAK, 20.0, 100.0):
        made = auto.map_auto(rgb, Context(l_max, l_max))
        assert made.shape == (*size, 4)
        assert made.dtype == np.float32
        assert 0 <= made.min() <= made.max() <= 1


def test_a_higher_peak_never_lowers_what_is_reached() -> None:
    stops = [
        auto.map_auto(lamps(), Context(l_max, l_max))[..., :3] * math.log2(l_max)
        for l_max in (1.5, 2.0, PEAK, 10.0, 20.0, 60.0)
    ]
    for less, more in pairwise(stops):
        assert (more >= less - 1e-5).all()


def test_threads_and_sizes_before_leave_no_trace() -> None:
    picture, other = lamps(), lamps(120, 200)
    alone = auto.map_auto(picture, DISPLAY).tobytes()

    def after_another(_: int) -> bytes:
        auto.map_auto(other, DISPLAY)
        return auto.map_auto(picture, DISPLAY).tobytes()

    with ThreadPoolExecutor(3) as pool:
        assert set(pool.map(after_another, range(6))) == {alone}


def test_a_panorama_shows_the_network_what_lies_beyond_its_sides() -> None:
    picture = np.roll(lamps(96, 192), -14, axis=1)
    turned = np.roll(picture, -96, axis=1)  # a lamp on the seam; 96 is a multiple of TILE_PX
    here = auto.map_auto(picture, DISPLAY, wrap_x=True)
    there = np.roll(auto.map_auto(turned, DISPLAY, wrap_x=True), 96, axis=1)
    flat = np.roll(auto.map_auto(turned, DISPLAY), 96, axis=1)
    # Where the map counts: below clipping the gate is shut, and the network's word is idle.
    bright = picture.max(-1) > 0.9
    # Far context still moves a little, as the network sees no further than its padding.
    assert np.abs(here - there)[bright].mean() < 0.5 * np.abs(here - flat)[bright].mean()


@pytest.mark.shared
def test_truth_on_scenes_that_the_fit_has_not_seen(tmp_path: Path) -> None:
    """PQ-PSNR of the luminance at 1000 nits, over SDR left as it is; docs/auto.md has them all."""
    gains_db = {}
    for name in ("apartment", "CS_Warwick", "park", "sunset"):
        bgr = cv2.imread(str(SHARED / f"data/panoramas/{name}.hdr"), cv2.IMREAD_UNCHANGED)
        assert bgr is not None
        truth = bgr[109:379, 163:643, ::-1].astype(np.float64)
        truth /= np.percentile(truth @ BT709, 94)
        codes = np.rint(255 * auto_levels.srgb_codes(np.clip(truth, 0, 1).astype(np.float32)))
        clip = write_ffv1(tmp_path / f"{name}.mkv", [codes.astype(np.uint8)])
        errors = []
        for strength in (0.0, 1.0):
            out = tmp_path / f"{name}{strength:g}"
            convert(clip, out, make_settings(strength=strength, transfer="srgb"))
            rgb = read_exr(next(out.glob("*.exr"))).channels
            got = sum(w * rgb[c].astype(np.float64) for w, c in zip(BT709, "RGB", strict=True))
            test, want = (np.clip(203 * y, 0.005, 1000) for y in (got, truth @ BT709))
            errors.append(pq_psnr_db(test, want))
        gains_db[name] = errors[1] - errors[0]
    assert min(gains_db.values()) > 1.5, gains_db
    assert np.mean(list(gains_db.values())) > 3, gains_db


def test_certainty_by_what_the_network_says_of_clipped_places() -> None:
    shares = np.zeros((3, 10, 16, 32), np.float32)
    clipped = np.zeros((32, 64), np.float32)
    assert auto_levels.certainty(auto_levels.where_clipped(shares, clipped)) == 1, "nothing clips"
    clipped[:, 32:] = 1
    shares[..., :16] = 0.5  # where nothing clips
    shares[:, :3, :, 16:] = 1
    assert auto_levels.certainty(auto_levels.where_clipped(shares, clipped)) == pytest.approx(1)
    shares[:, :3, :, 16:] = 0.3
    assert auto_levels.certainty(auto_levels.where_clipped(shares, clipped)) == pytest.approx(0.3)


def test_where_the_network_is_not_certain_highlights_rise_by_less(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    picture = np.full((64, 96, 3), 0.1, np.float32)
    picture[16:48, 24:72] = 1

    def stops(share: float) -> float:
        shares = np.full((3, 10, 32, 48), share, np.float32)
        monkeypatch.setattr(auto, "level_shares", lambda *_: shares)
        return float(auto.map_auto(picture, Context(4.9, 4.9))[32, 48, 1])

    assert stops(0.9) == pytest.approx(0.9, abs=0.02)
    assert stops(0.08) == pytest.approx(0.08 * auto.LEAST_TRUST, abs=0.004)
