"""native: the compiled loops do what their libraries' oracles do, and nothing needs them."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import hypothesis.strategies as st
import numpy as np
import numpy.typing as npt
import pytest
from clips import film_encoding
from compiled_kernels import ByLibraries, loaded, needs_kernels
from hypothesis import given

from itmo_video import make_settings
from itmo_video.colour.analysis_picture import analysis_guide
from itmo_video.colour.strips import strips
from itmo_video.expand_map.key_map import make_key_map
from itmo_video.kernels import library
from itmo_video.kernels.compiled import weighted_sum
from itmo_video.kernels.compiled_light import CodesToLight, ycbcr_rows
from itmo_video.look import make_look
from itmo_video.model import Family, Frame
from itmo_video.motion import flow
from itmo_video.operators.base import Context
from itmo_video.operators.photographic import gain_banterle2006
from itmo_video.rendering.frame import expand, render
from itmo_video.rendering.guidance import Guidance
from itmo_video.rendering.guided_upsampling import edge_aware_coefficients


def test_another_version_of_the_library_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(library, "_VERSION", -1)
    assert library._found.__wrapped__()[0] is None


# ---- maps and luminance (test_colour.py holds linear light against the equations) ----


@needs_kernels
@given(st.integers(0, 2**32 - 1), st.floats(2, 3))
def test_power(seed: int, gamma: float) -> None:
    """One line of grey: codes to light by a float64 power, 0 below what any half can show."""
    codes = np.random.default_rng(seed).integers(4097, 60161, (1, 64)).astype(np.uint16)
    codes[0, :4] = 4096, 60160, 4097, 4098  # black and white of 16 bits, the darkest steps
    flat = np.full((1, 64), 32768, np.uint16)
    out = [np.empty((1, 64), np.float32) for _ in range(3)]
    levels = (4096.0, 56064.0, 32768.0, 57344.0)
    to_light = CodesToLight((None, None), levels, (1, 1, 1, 1), gamma)
    ycbcr_rows(loaded, (codes, flat, flat), slice(0, 1), to_light, out)
    want = ((codes - 4096.0) / 56064) ** gamma
    np.testing.assert_allclose(out[1], want, rtol=1e-6, atol=0.5**30)
    assert out[1][0, 0] == 0
    assert out[1][0, 1] == 1


@needs_kernels
@pytest.mark.parametrize("edge_aware", [True, False])
@pytest.mark.parametrize("guards", [True, False])
@pytest.mark.parametrize("channels", [0, 1, 3])
@pytest.mark.parametrize("size", [(96, 128), (270, 480), (131, 517)])
def test_guidance(
    by_libraries: ByLibraries, size: tuple[int, int], channels: int, guards: bool, edge_aware: bool
) -> None:
    settings = make_settings("default", noise_guard=guards, map_width=128)
    rng = np.random.default_rng(8)
    encoding = film_encoding("grey")
    frame = Frame(0, Fraction(0), (rng.integers(0, 256, size, dtype=np.uint8),), encoding)
    guide = analysis_guide(frame, 128)
    maps = None
    if channels:
        shape = guide.shape if channels == 1 else (*guide.shape, 3)
        maps = rng.random(shape, np.float32)
    guidance = Guidance(frame, guide, settings, maps, edge_aware)
    for rows in strips(size[0]):
        ours, ratio = guidance.rows(rows)
        theirs, want = by_libraries(guidance.rows, rows)
        assert len(ours) == len(theirs) == channels
        for part, other in zip(ours, theirs, strict=True):
            np.testing.assert_allclose(part, other, atol=2e-6)
        assert (ratio is None) == (want is None) == (not guards)
        if ratio is not None:
            np.testing.assert_allclose(ratio, want, atol=4e-6)


@needs_kernels
@pytest.mark.parametrize("with_ratio", [True, False])
def test_drive(with_ratio: bool) -> None:
    rng = np.random.default_rng(9)
    rgb = [rng.normal(0.5, 0.5, (5, 67)).astype(np.float32) for _ in range(3)]
    ratio = rng.random((5, 67), np.float32) if with_ratio else None
    weights = (0.213, 0.715, 0.072)
    want = sum(w * plane.astype(np.float64) for w, plane in zip(weights, rgb, strict=True))
    want = np.clip(want * (1 if ratio is None else ratio), 0, 1)
    np.testing.assert_allclose(weighted_sum(loaded, rgb, weights, ratio), want, atol=1e-6)


@needs_kernels
@pytest.mark.parametrize("is_same", [True, False])
@pytest.mark.parametrize("radius", [0, 1, 3, 40])
@pytest.mark.parametrize("size", [(1, 1), (5, 60), (60, 5), (72, 128)])
def test_guided_coefficients(
    by_libraries: ByLibraries, size: tuple[int, int], radius: int, is_same: bool
) -> None:
    rng = np.random.default_rng(10)
    guide = rng.random(size, np.float32)
    values = guide if is_same else rng.random(size, np.float32)
    ours = edge_aware_coefficients(values, guide, radius, 1e-3)
    theirs = by_libraries(edge_aware_coefficients, values, guide, radius, 1e-3)
    for part, other in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(part, other, rtol=1e-6, atol=1e-6)


@needs_kernels
@pytest.mark.parametrize("l_max", [2.0, 20.0])
def test_gain_banterle2006_to_the_bit(by_libraries: ByLibraries, l_max: float) -> None:
    luminance = np.random.default_rng(11).random((7, 131), np.float32)
    luminance[0, :2] = 0, 1
    context = Context(l_max, 0.9 * l_max)
    ours = gain_banterle2006(luminance, context)
    assert np.array_equal(ours, by_libraries(gain_banterle2006, luminance, context))


@needs_kernels
def test_every_half_and_what_lies_between() -> None:
    """Products by a gain of 1 (no weight) round to halves as NumPy's do, up to infinity."""
    halves = np.arange(0x7C00, dtype=np.uint16).view(np.float16).astype(np.float32)
    middles = ((halves[1:] + halves[:-1]) / 2).astype(np.float32)
    beside = [np.nextafter(middles, np.float32(to)) for to in (0, np.inf)]
    ends = np.array([65519, 65520, 1e9, 1e-30, 3e-8], np.float32)
    values = np.concatenate([halves, middles, *beside, ends])
    values = np.concatenate([values, -values])
    out = np.empty((3, values.size), np.float16)
    weight = np.zeros_like(values)
    expand([values] * 3, weight + 7, weight, 1.0, 1.0, out)
    with np.errstate(over="ignore"):
        want = values.astype(np.float16)
    for plane in out:
        assert np.array_equal(plane.view(np.uint16), want.view(np.uint16))


@needs_kernels
@pytest.mark.parametrize("strength", [1.0, 0.15])
def test_expand_to_the_bit(by_libraries: ByLibraries, strength: float) -> None:
    rng = np.random.default_rng(12)
    rgb = [rng.random((40, 131), np.float32) for _ in range(3)]
    gain, weight = 1 + 9 * rng.random((40, 131), np.float32), rng.random((40, 131), np.float32)
    out = np.empty((3, 40, 131), np.float16)
    expand(rgb, gain, weight, 0.7, strength, out)
    want = np.empty_like(out)
    by_libraries(expand, rgb, gain, weight, 0.7, strength, want)
    assert np.array_equal(out, want)


@needs_kernels
@pytest.mark.parametrize("count", [1, 5, 8, 1032])
def test_camera_model(by_libraries: ByLibraries, count: int) -> None:
    """Most places on an affine motion, some off it: the one elimination finds what LAPACK does."""
    rng = np.random.default_rng(13)
    across, down = rng.random((2, count)) - 0.5
    vectors = np.stack([1 + 2 * across - down, -3 + 0.5 * down]) + rng.normal(0, 0.2, (2, count))
    vectors[:, ::4] += 9
    texture = rng.integers(1, 50, count).astype(np.float64)
    given = (across, down, vectors, texture, flow.CAMERA_SIGMAS_PX, flow.CAMERA_RIDGE)
    ours = flow.camera_model(*given)
    theirs = by_libraries(flow.camera_model, *given)
    np.testing.assert_allclose(ours, theirs, rtol=1e-6, atol=1e-8)


# ---- whole frames ----


def picture(family: Family) -> Frame:
    """A frame of 150 by 300 with a lamp on its seam, grain and colour."""
    rng = np.random.default_rng(14)
    y, x = np.mgrid[:150, :300]
    lamp = 90 * (np.hypot((x + 20) % 300 - 30, y - 60) < 25)

    def plane(step: int, base: float) -> npt.NDArray[np.uint8]:
        values = base + lamp[::step, ::step] + rng.normal(0, 3, lamp[::step, ::step].shape)
        return np.asarray(np.clip(values, 16, 235), np.uint8)

    planes: dict[Family, tuple[npt.NDArray[np.uint8], ...]] = {
        "ycbcr": (plane(1, 120), plane(2, 90), plane(2, 100)),
        "rgb": (plane(1, 120), plane(1, 140), plane(1, 100)),
        "grey": (plane(1, 120),),
    }
    encoding = film_encoding(family)
    return Frame(0, Fraction(0), planes[family], encoding)


@needs_kernels
@pytest.mark.parametrize("family", ["ycbcr", "rgb", "grey"])
@pytest.mark.parametrize("projection", ["flat", "latlong"])
@pytest.mark.parametrize("preset", ["default", "paper", "ibl"])
@pytest.mark.parametrize("map_width", [128, 512])
def test_frames_are_the_same_by_libraries(
    by_libraries: ByLibraries, map_width: int, preset: str, projection: str, family: Family
) -> None:
    frame = picture(family)
    look = make_look(make_settings(preset, projection=projection, map_width=map_width))

    def made() -> Any:
        return np.stack(render(frame, make_key_map(frame, look), look).rgb)

    ours, theirs = made(), by_libraries(made)
    np.testing.assert_allclose(
        ours.astype(np.float64), theirs.astype(np.float64), rtol=3e-3, atol=1e-5
    )
    assert np.mean(ours != theirs) < 0.01
