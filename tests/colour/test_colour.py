"""Colour against closed forms, colour-science and OpenColorIO, and strips against whole frames."""

from __future__ import annotations

import warnings
from fractions import Fraction
from typing import get_args

import cv2
import numpy as np
import pytest
from oracles import to_rgb_code

from itmo_video.colour import chroma, linear_light, primaries
from itmo_video.colour.transfer import eotf, inverse_eotf
from itmo_video.model import ChromaSiting, Encoding, Frame

pytestmark = pytest.mark.usefixtures("loops")

RATIO = {"420": (2, 2), "422": (2, 1), "440": (1, 2), "444": (1, 1)}
SDR = ("bt1886", "srgb", "gamma22", "linear")


def colour_science():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it warns of every optional package that is missing
        return pytest.importorskip("colour")


def encoding(family="ycbcr", depth=8, matrix="bt709", range_="limited", transfer="bt1886", **kw):
    return Encoding(family, depth, matrix, range_, transfer, "rec709", **kw)


def frame_of(planes, enc):
    return Frame(0, Fraction(0), tuple(planes), enc)


def random_frame(width, height, enc, subsampling="420", seed=0):
    rng = np.random.default_rng(seed)
    dtype = np.uint8 if enc.bit_depth == 8 else np.uint16
    across, down = RATIO[subsampling]
    small = (-(-height // down), -(-width // across))
    shapes = [(height, width), small, small] if enc.family == "ycbcr" else [(height, width)] * 3
    if enc.family == "grey":
        shapes = shapes[:1]
    return frame_of([rng.integers(0, 2**enc.bit_depth, s, dtype=dtype) for s in shapes], enc)


def reference_code(frame):
    """R'G'B' in float64 by solving the forward equations of BT.601, 709 and 2020."""
    enc, (width, height) = frame.encoding, frame.size
    kr, kb = {"bt709": (0.2126, 0.0722), "bt601": (0.299, 0.114), "bt2020": (0.2627, 0.0593)}[
        enc.matrix
    ]
    luma = np.array([kr, 1 - kr - kb, kb])
    forward = np.stack(
        [luma, ([0, 0, 1] - luma) / (2 * (1 - kb)), ([1, 0, 0] - luma) / (2 * (1 - kr))]
    )
    step = 2.0 ** (enc.bit_depth - 8)
    top = 2.0**enc.bit_depth - 1
    y = frame.planes[0].astype(np.float64)
    subsampled = [
        chroma.upsample_chroma(p, (width, height), enc.siting) - 128 * step
        for p in frame.planes[1:3]
    ]
    if enc.range == "limited":
        ycc = [(y - 16 * step) / (219 * step), *(c / (224 * step) for c in subsampled)]
    else:
        ycc = [y / top, *(c / top for c in subsampled)]
    return np.einsum("ij,jhw->ihw", np.linalg.inv(forward), np.stack(ycc))


# ---- transfer ----


@pytest.mark.parametrize("transfer", SDR)
def test_inverse_undoes_eotf(transfer):
    x = np.concatenate([np.linspace(-0.2, 1.1, 1001), [0.0, 1.0]])
    assert np.abs(inverse_eotf(eotf(x, transfer), transfer) - x).max() < 3e-7
    assert eotf(np.array(1.0), transfer) == pytest.approx(1.0, abs=1e-15)
    np.testing.assert_array_equal(eotf(-x, transfer), -eotf(x, transfer))


def test_eotfs_match_colour_science():
    science = colour_science()

    x = np.linspace(0, 1, 4096)
    np.testing.assert_allclose(
        eotf(x, "bt1886"), science.models.eotf_BT1886(x, L_B=0, L_W=1), rtol=1e-12, atol=0
    )
    np.testing.assert_allclose(eotf(x, "srgb"), science.models.eotf_sRGB(x), rtol=1e-7, atol=0)
    np.testing.assert_allclose(eotf(x, "gamma22"), x**2.2, rtol=1e-12)


def test_srgb_matches_opencolorio():
    ocio = pytest.importorskip("PyOpenColorIO")
    curve = ocio.ExponentWithLinearTransform([2.4, 2.4, 2.4, 1], [0.055, 0.055, 0.055, 0])
    processor = ocio.Config.CreateRaw().getProcessor(curve).getDefaultCPUProcessor()
    x = np.linspace(0, 1, 1000, dtype=np.float32)
    rgb = np.repeat(x[:, None], 3, 1).copy()
    processor.applyRGB(rgb)
    np.testing.assert_allclose(eotf(x, "srgb"), rgb[:, 0], rtol=2e-4, atol=1e-6)


@pytest.mark.parametrize("transfer", ["pq", "hlg"])
def test_hdr_transfers_are_refused(transfer):
    with pytest.raises(ValueError, match=transfer):
        eotf(np.zeros(3), transfer)
    with pytest.raises(ValueError, match=transfer):
        linear_light.to_rgb_linear(random_frame(8, 8, encoding(transfer=transfer)), clip=True)


# ---- primaries ----


@pytest.mark.parametrize("source", ["rec709", "rec2020", "p3d65", "acescg", "aces2065-1"])
@pytest.mark.parametrize("target", ["rec709", "rec2020", "acescg", "aces2065-1"])
def test_matrices_match_colour_science(source, target):
    science = colour_science()

    names = {
        "rec709": "ITU-R BT.709",
        "rec2020": "ITU-R BT.2020",
        "p3d65": "P3-D65",
        "acescg": "ACEScg",
        "aces2065-1": "ACES2065-1",
    }
    spaces = []
    for name in (source, target):
        space = science.RGB_COLOURSPACES[names[name]].copy()
        space.use_derived_transformation_matrices(True)
        spaces.append(space)
    want = science.matrix_RGB_to_RGB(*spaces, chromatic_adaptation_transform="Bradford")
    np.testing.assert_allclose(primaries.rgb_to_rgb_matrix(source, target), want, atol=2e-4)


@pytest.mark.parametrize("source", primaries.CHROMATICITIES)
@pytest.mark.parametrize("target", primaries.CHROMATICITIES)
def test_white_stays_white_and_back_is_inverse(source, target):
    there = primaries.rgb_to_rgb_matrix(source, target)
    np.testing.assert_allclose(there @ np.ones(3), 1, atol=1e-12)
    back = primaries.rgb_to_rgb_matrix(target, source)
    np.testing.assert_allclose(there @ back, np.eye(3), atol=1e-12)


def test_luminance_weights():
    assert primaries.luminance_weights("rec709") == pytest.approx(
        (0.2126, 0.7152, 0.0722), abs=1e-4
    )
    assert primaries.luminance_weights("rec2020") == pytest.approx(
        (0.2627, 0.6780, 0.0593), abs=1e-4
    )
    for name in primaries.CHROMATICITIES:
        assert sum(primaries.luminance_weights(name)) == pytest.approx(1, abs=1e-12)


# ---- codes to light ----


@pytest.mark.parametrize("subsampling", RATIO)
@pytest.mark.parametrize("siting", get_args(ChromaSiting))
def test_fast_chroma_equals_the_plain_one(subsampling, siting):
    for size in ((64, 48), (33, 7), (1, 1), (2, 3), (129, 81)):
        frame = random_frame(*size, encoding(siting=siting, matrix="bt601"), subsampling)
        got = np.stack(to_rgb_code(frame))
        np.testing.assert_allclose(got, reference_code(frame), atol=2e-6)


@pytest.mark.parametrize("matrix", ["bt709", "bt601", "bt2020"])
@pytest.mark.parametrize("range_", ["limited", "full"])
@pytest.mark.parametrize("depth", [8, 9, 10, 12, 14, 16])
def test_codes_match_the_equations(matrix, range_, depth):
    frame = random_frame(70, 50, encoding("ycbcr", depth, matrix, range_))
    got = np.stack(to_rgb_code(frame))
    assert got.dtype == np.float32
    np.testing.assert_allclose(got, reference_code(frame), atol=3e-6)


@pytest.mark.parametrize("transfer", SDR)
@pytest.mark.parametrize("clip", [False, True])
def test_light_is_accurate_down_to_the_darkest_code(transfer, clip):
    for depth, range_ in ((8, "full"), (8, "limited"), (10, "full"), (10, "limited")):
        codes = np.arange(2**depth, dtype=np.uint8 if depth == 8 else np.uint16).reshape(8, -1)
        middle = np.full_like(codes, 2 ** (depth - 1))
        grey = frame_of(
            [codes, middle, middle], encoding("ycbcr", depth, "bt709", range_, transfer)
        )
        step = 2.0 ** (depth - 8)
        x = codes / (2.0**depth - 1) if range_ == "full" else (codes / step - 16) / 219
        want = eotf(np.clip(x, 0, 1) if clip else x, transfer)
        for plane in linear_light.to_rgb_linear(grey, clip=clip):
            np.testing.assert_allclose(plane, want, rtol=1e-4, atol=1e-12)


@pytest.mark.parametrize("family", ["rgb", "grey"])
@pytest.mark.parametrize("depth", [8, 16])
@pytest.mark.parametrize("transfer", ["bt1886", "srgb"])
def test_rgb_and_grey_codes_are_exact(family, depth, transfer):
    frame = random_frame(40, 50, encoding(family, depth, range_="full", transfer=transfer))
    got = linear_light.to_rgb_linear(frame, clip=True)
    for i, plane in enumerate(got):
        code = frame.planes[i if family == "rgb" else 0] / (2.0**depth - 1)
        np.testing.assert_allclose(plane, eotf(code, transfer), rtol=2e-7)


@pytest.mark.parametrize(("depth", "range_", "white", "black"), [
    (8, "limited", 235, 16), (8, "full", 255, 0), (10, "limited", 940, 64), (12, "full", 4095, 0),
])  # fmt: skip
@pytest.mark.parametrize("transfer", SDR)
def test_white_is_one_and_black_is_nought(depth, range_, white, black, transfer):
    dtype = np.uint8 if depth == 8 else np.uint16
    for code, want in ((white, 1.0), (black, 0.0)):
        planes = [np.full((4, 6), code, dtype)]
        planes += [np.full((2, 3), 2 ** (depth - 1), dtype)] * 2
        enc = encoding("ycbcr", depth, "bt709", range_, transfer)
        for plane in linear_light.to_rgb_linear(frame_of(planes, enc), clip=False):
            np.testing.assert_allclose(plane, want, atol=3e-6 * want)


def test_values_out_of_range_are_kept_unless_clipped():
    planes = [np.array([[255, 0]], np.uint8), *[np.full((1, 1), 128, np.uint8)] * 2]
    frame = frame_of(planes, encoding())
    (over, under), *_ = linear_light.to_rgb_linear(frame, clip=False)[0]
    assert over == pytest.approx((239 / 219) ** 2.4, rel=1e-5)
    assert under == pytest.approx(-((16 / 219) ** 2.4), rel=1e-4)
    assert linear_light.to_rgb_linear(frame, clip=True)[0].tolist() == [[1.0, 0.0]]


@pytest.mark.parametrize("size", [(96, 90), (100, 83), (1280, 50), (7, 45), (256, 41)])
@pytest.mark.parametrize("subsampling", RATIO)
@pytest.mark.parametrize("clip", [False, True])
def test_any_strip_is_the_whole_frames_rows(size, subsampling, clip):
    rng = np.random.default_rng(sum(size))
    for transfer, siting in (("bt1886", "left"), ("srgb", "topleft"), ("bt1886", "bottom")):
        enc = encoding(transfer=transfer, siting=siting)
        frame = random_frame(*size, enc, subsampling)
        whole = linear_light.to_rgb_linear(frame, clip=clip)
        for _ in range(6):
            top, stop = sorted(rng.choice(size[1] + 1, 2, replace=False))
            out = tuple(np.empty((stop - top, size[0]), np.float32) for _ in range(3))
            linear_light.strip_to_rgb_linear(frame, slice(top, stop), clip, out)
            for strip, plane in zip(out, whole, strict=True):
                np.testing.assert_array_equal(strip, plane[top:stop])


def test_upsampling_finds_a_ramp_again():
    """Chroma sampled from a ramp at the sited positions comes back as the ramp, edges aside."""
    x, y = np.meshgrid(np.arange(64.0), np.arange(32.0))
    for siting, at in (("left", (0, 0.5)), ("center", (0.5, 0.5)), ("topleft", (0, 0))):
        sampled = 4 * (x[::2, ::2] + at[0]) + 8 * (y[::2, ::2] + at[1])
        plane = sampled.astype(np.uint16)
        got = chroma.upsample_chroma(plane, (64, 32), siting)
        np.testing.assert_allclose(got[2:-2, 2:-2], (4 * x + 8 * y)[2:-2, 2:-2], atol=1e-9)


def test_results_do_not_depend_on_threads_of_cv2():
    frame = random_frame(640, 360, encoding(transfer="srgb"))
    before = cv2.getNumThreads()
    try:
        results = []
        for count in (1, 4):
            cv2.setNumThreads(count)
            results.append(np.stack(linear_light.to_rgb_linear(frame, clip=True)))
    finally:
        cv2.setNumThreads(before)
    np.testing.assert_array_equal(*results)


@pytest.mark.benchmark
def test_speed_of_1080p(benchmark):
    cv2.setNumThreads(1)
    frame = random_frame(1920, 1080, encoding())
    benchmark(linear_light.to_rgb_linear, frame, clip=True)
