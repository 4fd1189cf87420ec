"""Light to dithered Y'CbCr codes: both forms against BT.2100 and BT.2390 in float64.

A code is a value and noise, rounded; so it lies within half a code of their sum, and what it lies
beyond that is how far the value is off.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from itmo_video.colour import transfer
from itmo_video.colour.primaries import luminance_weights, rgb_to_rgb_matrix
from itmo_video.delivery import hdr
from itmo_video.delivery.choices import Chroma
from itmo_video.delivery.eetf import bt2390_eetf
from itmo_video.delivery.ycbcr import codes_form, dither_noise, to_ycbcr
from itmo_video.kernels import library
from itmo_video.kernels.compiled_codes import NOISE_TILE, Curve

Float64 = npt.NDArray[np.float64]
FORMS = ["compiled", "plain"]
# Of a 10-bit code: the compiled form has polynomials, the plain one tables by half floats.
OFF = {"compiled": 0.025, "plain": 0.1}


@pytest.fixture(params=FORMS)
def off(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> float:
    """How far codes may be off in one of the forms, which is in use then."""
    if request.param == "plain":
        monkeypatch.setattr(library, "library", lambda: None)
    elif library.library() is None:
        pytest.skip("installed without a C compiler")
    return OFF[request.param]


def expected(code: Float64, chroma: Chroma, index: int) -> list[Float64]:
    """Y', Cb and Cr of R'G'B' (3, H, W) of even size, in codes, with the noise, not rounded."""
    kr, kb = 0.2627, 0.0593  # BT.2020-2, table 4
    luma = kr * code[0] + (1 - kr - kb) * code[1] + kb * code[2]
    planes = [luma * 876 + 64]
    for plane, k in ((code[2], kb), (code[0], kr)):
        apart = (plane - luma) / (2 * (1 - k))
        if chroma == "420":
            apart = (apart[0::2] + apart[1::2]) / 2
        if chroma != "444":
            left = np.pad(apart, ((0, 0), (1, 0)), "edge")
            apart = (left[:, 0:-1:2] + 2 * apart[:, 0::2] + apart[:, 1::2]) / 4
        planes.append(apart * 896 + 512)
    form = codes_form("bt2020", chroma, index)
    for plane, (x, y) in zip(planes, form.noise_at, strict=True):
        rows, columns = np.indices(plane.shape)
        plane += dither_noise()[(rows + y) % NOISE_TILE, (columns + x) % NOISE_TILE]
    return planes


def light_to_code(nits: Float64, curve: Curve, peak: float) -> Float64:
    """R'G'B' of nits of BT.2020, (3, ...)."""
    if curve == "pq":
        return transfer.pq_code(nits)
    gamma = transfer.hlg_gamma(peak)
    y = np.tensordot(luminance_weights("rec2020"), nits, 1) / peak
    return transfer.hlg_oetf(np.minimum(nits / peak * np.maximum(y, 1e-8) ** (1 / gamma - 1), 1))


def picture(shape: tuple[int, int], dtype: Any = np.float16) -> npt.NDArray[Any]:
    """R, G, B from 0 to beyond the peak, from black to bright, and coloured."""
    rng = np.random.default_rng(4)
    level = 2 ** rng.uniform(-16, 3, shape)
    level[rng.random(shape) < 0.1] = 0
    return np.asarray(level * rng.uniform(0.2, 1, (3, *shape)), dtype)


def padded(planes: Float64) -> Float64:
    down, right = planes.shape[1] % 2, planes.shape[2] % 2
    return np.pad(planes, ((0, 0), (0, down), (0, right)), "edge")


def beyond(codes: Any, planes: list[Float64]) -> float:
    """How far codes are at most from what rounds to them."""
    away = (abs(code - plane).max() for code, plane in zip(codes, planes, strict=True))
    return float(max(away)) - 0.5


@pytest.mark.parametrize("chroma", ["420", "422", "444"])
@pytest.mark.parametrize("shape", [(40, 300), (33, 257), (2, 128), (5, 3), (1, 1)])
def test_pq(off: float, chroma: Chroma, shape: tuple[int, int]) -> None:
    rgb, peak, white = picture(shape), 1000.0, 203.0
    matrix = rgb_to_rgb_matrix("rec709", "rec2020") * white
    nits = np.clip(np.tensordot(matrix, rgb.astype(np.float64), 1), 0, peak)
    planes, light = hdr.master_frame(tuple(rgb), "rec709", white, peak, "pq", chroma, 7)
    assert beyond(planes, expected(padded(light_to_code(nits, "pq", peak)), chroma, 7)) < off
    assert light.peak == pytest.approx(nits.max(), rel=1e-6)
    assert light.average == pytest.approx(nits.max(0).mean(), rel=1e-5), "padding counts, or not"


@pytest.mark.parametrize("peak", [400.0, 1000.0, 10000.0])
@pytest.mark.parametrize("curve", ["pq", "hlg"])
@pytest.mark.parametrize("dtype", [np.float16, np.float32])
def test_curves_and_dtypes(off: float, curve: Curve, peak: float, dtype: Any) -> None:
    rgb = picture((32, 256), dtype)
    nits = np.clip(rgb.astype(np.float64) * 1500, 0, peak)
    planes, _ = hdr.master_frame(tuple(rgb), "rec2020", 1500, peak, curve, "420", 0)
    assert beyond(planes, expected(light_to_code(nits, curve, peak), "420", 0)) < off


def test_a_darker_display(off: float) -> None:
    rgb, peak, display = picture((32, 256)), 1000.0, 400.0
    nits = np.clip(rgb.astype(np.float64) * 203, 0, peak)
    most = np.maximum(nits.max(0), 1e-6)
    shown = nits * (bt2390_eetf(most, peak, display) / most)
    planes, light = hdr.master_frame(tuple(rgb), "rec2020", 203, peak, "pq", "420", 3, display)
    # The factor is looked up by a half float in both forms.
    assert beyond(planes, expected(light_to_code(shown, "pq", peak), "420", 3)) < off + 0.1
    assert light.peak == pytest.approx(shown.max(), rel=1e-3)


def test_black_stays_black(off: float) -> None:
    """Noise of less than half a code leaves black at 64, as PQ's code of 0 is 7e-7."""
    del off
    black = np.zeros((8, 256), np.float16)
    planes, _ = hdr.master_frame((black,) * 3, "rec2020", 1, 10000, "pq", "420", 1)
    assert np.mean(planes[0] != 64) < 0.002
    assert [set(np.unique(plane)) for plane in planes[1:]] == [{512}, {512}]


@pytest.mark.skipif(library.library() is None, reason="installed without a C compiler")
def test_light_beyond_numbers_stays_in_range() -> None:
    rgb = np.full((3, 4, 300), np.nan, np.float16)
    rgb[0, :, ::2], rgb[1, :, ::3], rgb[2] = np.inf, -np.inf, -1
    planes, light = hdr.master_frame(tuple(rgb), "acescg", 203, 1000, "pq", "422", 1)
    assert all(plane.min() >= 4 and plane.max() <= 1019 for plane in planes)
    assert 0 <= light.average <= light.peak <= 1000


@pytest.mark.parametrize("depth", [8, 10])
def test_codes_out_of_range_are_limited(off: float, depth: int) -> None:
    del off
    high, low = np.full((4, 300), 5, np.float32), np.full((4, 300), -5, np.float32)
    luma, cb, cr = to_ycbcr((low, low, high), "bt709", "420", 1, depth)
    step = 2 ** (depth - 10)
    assert set(np.unique(luma)) == {4 * step}, "codes for synchronisation"
    assert set(np.unique(cb)) == {1019.75 * step // 1}
    assert len(np.unique(cr)) > 1
