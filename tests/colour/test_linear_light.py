"""Codes to linear light: against the equations of BT.601, 709 and 2020; strips as whole frames."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from fractions import Fraction
from typing import Any, get_args

import cv2
import numpy as np
import pytest
from oracles import to_rgb_code

from itmo_video.colour import chroma, linear_light
from itmo_video.colour.transfer import eotf
from itmo_video.model import (
    ChromaSiting,
    Code,
    Encoding,
    Family,
    Float64,
    Frame,
    Matrix,
    Range,
    Transfer,
)  # fmt: skip

pytestmark = pytest.mark.usefixtures("loops")

RATIO = {"420": (2, 2), "422": (2, 1), "440": (1, 2), "444": (1, 1)}
SDR = ("bt1886", "srgb", "gamma22", "linear")


def encoding(
    family: Family = "ycbcr",
    depth: int = 8,
    matrix: Matrix = "bt709",
    range_: Range = "limited",
    transfer: Transfer = "bt1886",
    **kw: Any,
) -> Encoding:
    return Encoding(family, depth, matrix, range_, transfer, "rec709", **kw)


def frame_of(planes: Iterable[Code], enc: Encoding) -> Frame:
    return Frame(0, Fraction(0), tuple(planes), enc)


def random_frame(
    width: int, height: int, enc: Encoding, subsampling: str = "420", seed: int = 0
) -> Frame:
    rng = np.random.default_rng(seed)
    dtype: Any = np.uint8 if enc.bit_depth == 8 else np.uint16
    across, down = RATIO[subsampling]
    small = (-(-height // down), -(-width // across))
    shapes = [(height, width), small, small] if enc.family == "ycbcr" else [(height, width)] * 3
    if enc.family == "grey":
        shapes = shapes[:1]
    return frame_of([rng.integers(0, 2**enc.bit_depth, s, dtype=dtype) for s in shapes], enc)


def reference_code(frame: Frame) -> Float64:
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
    return np.asarray(np.einsum("ij,jhw->ihw", np.linalg.inv(forward), np.stack(ycc)))


@pytest.mark.parametrize("transfer", ["pq", "hlg"])
def test_hdr_transfers_are_refused(transfer: Transfer) -> None:
    with pytest.raises(ValueError, match=transfer):
        eotf(np.zeros(3), transfer)
    with pytest.raises(ValueError, match=transfer):
        linear_light.to_rgb_linear(random_frame(8, 8, encoding(transfer=transfer)), clip=True)


# ---- codes to light ----


@pytest.mark.parametrize("subsampling", RATIO)
@pytest.mark.parametrize("siting", get_args(ChromaSiting))
def test_fast_chroma_equals_the_plain_one(subsampling: str, siting: ChromaSiting) -> None:
    for size in ((64, 48), (33, 7), (1, 1), (2, 3), (129, 81)):
        frame = random_frame(*size, encoding(siting=siting, matrix="bt601"), subsampling)
        got = np.stack(to_rgb_code(frame))
        np.testing.assert_allclose(got, reference_code(frame), atol=2e-6)


@pytest.mark.parametrize("matrix", ["bt709", "bt601", "bt2020"])
@pytest.mark.parametrize("range_", ["limited", "full"])
@pytest.mark.parametrize("depth", [8, 9, 10, 12, 14, 16])
def test_codes_match_the_equations(matrix: Matrix, range_: Range, depth: int) -> None:
    frame = random_frame(70, 50, encoding("ycbcr", depth, matrix, range_))
    got = np.stack(to_rgb_code(frame))
    assert got.dtype == np.float32
    np.testing.assert_allclose(got, reference_code(frame), atol=3e-6)


@pytest.mark.parametrize("transfer", SDR)
@pytest.mark.parametrize("clip", [False, True])
def test_light_is_accurate_down_to_the_darkest_code(transfer: Transfer, clip: bool) -> None:
    kinds: tuple[tuple[int, Range], ...] = (
        (8, "full"), (8, "limited"), (10, "full"), (10, "limited")
    )  # fmt: skip
    for depth, range_ in kinds:
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
def test_rgb_and_grey_codes_are_exact(family: Family, depth: int, transfer: Transfer) -> None:
    frame = random_frame(40, 50, encoding(family, depth, range_="full", transfer=transfer))
    got = linear_light.to_rgb_linear(frame, clip=True)
    for i, plane in enumerate(got):
        code = frame.planes[i if family == "rgb" else 0] / (2.0**depth - 1)
        np.testing.assert_allclose(plane, eotf(code, transfer), rtol=2e-7)


@pytest.mark.parametrize(("depth", "range_", "white", "black"), [
    (8, "limited", 235, 16), (8, "full", 255, 0), (10, "limited", 940, 64), (12, "full", 4095, 0),
])  # fmt: skip
@pytest.mark.parametrize("transfer", SDR)
def test_white_is_one_and_black_is_nought(
    depth: int, range_: Range, white: int, black: int, transfer: Transfer
) -> None:
    dtype = np.uint8 if depth == 8 else np.uint16
    for code, want in ((white, 1.0), (black, 0.0)):
        planes = [np.full((4, 6), code, dtype)]
        planes += [np.full((2, 3), 2 ** (depth - 1), dtype)] * 2
        enc = encoding("ycbcr", depth, "bt709", range_, transfer)
        for plane in linear_light.to_rgb_linear(frame_of(planes, enc), clip=False):
            np.testing.assert_allclose(plane, want, atol=3e-6 * want)


def test_values_out_of_range_are_kept_unless_clipped() -> None:
    planes = [np.array([[255, 0]], np.uint8), *[np.full((1, 1), 128, np.uint8)] * 2]
    frame = frame_of(planes, encoding())
    (over, under), *_ = linear_light.to_rgb_linear(frame, clip=False)[0]
    assert over == pytest.approx((239 / 219) ** 2.4, rel=1e-5)
    assert under == pytest.approx(-((16 / 219) ** 2.4), rel=1e-4)
    assert linear_light.to_rgb_linear(frame, clip=True)[0].tolist() == [[1.0, 0.0]]


@pytest.mark.parametrize("size", [(96, 90), (100, 83), (1280, 50), (7, 45), (256, 41)])
@pytest.mark.parametrize("subsampling", RATIO)
@pytest.mark.parametrize("clip", [False, True])
def test_any_strip_is_the_whole_frames_rows(
    size: tuple[int, int], subsampling: str, clip: bool
) -> None:
    rng = np.random.default_rng(sum(size))
    kinds: tuple[tuple[Transfer, ChromaSiting], ...] = (
        ("bt1886", "left"), ("srgb", "topleft"), ("bt1886", "bottom")
    )  # fmt: skip
    for transfer, siting in kinds:
        enc = encoding(transfer=transfer, siting=siting)
        frame = random_frame(*size, enc, subsampling)
        whole = linear_light.to_rgb_linear(frame, clip=clip)
        for _ in range(6):
            top, stop = sorted(rng.choice(size[1] + 1, 2, replace=False))
            red, green, blue = np.empty((3, stop - top, size[0]), np.float32)
            out = (red, green, blue)
            linear_light.strip_to_rgb_linear(frame, slice(top, stop), clip, out)
            for strip, plane in zip(out, whole, strict=True):
                np.testing.assert_array_equal(strip, plane[top:stop])


def test_upsampling_finds_a_ramp_again() -> None:
    """Chroma sampled from a ramp at the sited positions comes back as the ramp, edges aside."""
    x, y = np.meshgrid(np.arange(64.0), np.arange(32.0))
    places: dict[ChromaSiting, tuple[float, float]] = {
        "left": (0, 0.5), "center": (0.5, 0.5), "topleft": (0, 0)
    }  # fmt: skip
    for siting, at in places.items():
        sampled = 4 * (x[::2, ::2] + at[0]) + 8 * (y[::2, ::2] + at[1])
        plane = sampled.astype(np.uint16)
        got = chroma.upsample_chroma(plane, (64, 32), siting)
        np.testing.assert_allclose(got[2:-2, 2:-2], (4 * x + 8 * y)[2:-2, 2:-2], atol=1e-9)


def test_results_do_not_depend_on_threads_of_cv2() -> None:
    frame = random_frame(640, 360, encoding(transfer="srgb"))
    before = cv2.getNumThreads()
    try:
        results = []
        for count in (1, 4):
            cv2.setNumThreads(count)
            results.append(np.stack(linear_light.to_rgb_linear(frame, clip=True)))
    finally:
        cv2.setNumThreads(before)
    one, four = results
    np.testing.assert_array_equal(one, four)


@pytest.mark.benchmark
def test_speed_of_1080p(benchmark: Callable[..., object]) -> None:
    cv2.setNumThreads(1)
    frame = random_frame(1920, 1080, encoding())
    benchmark(linear_light.to_rgb_linear, frame, clip=True)
