"""The whole picture path against closed forms, through the command as a user runs it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from clips import write_ffv1

from itmo_video import RunOptions, convert, make_settings
from itmo_video.output.exr import read_exr

pytestmark = pytest.mark.usefixtures("loops")

CODES = np.arange(256, dtype=np.uint8)


def ramp_clip(path: Path) -> Path:
    rows = np.repeat(CODES[None, :], 16, axis=0)
    return write_ffv1(path, [np.dstack([rows] * 3)])


def srgb_to_linear(codes: npt.NDArray[np.uint8]) -> npt.NDArray[np.float64]:
    v = codes / 255.0
    return np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)


def first_exr(folder: Path) -> dict[str, npt.NDArray[np.float64]]:
    (path,) = sorted(folder.glob("*.exr"))
    return {name: plane.astype(np.float64) for name, plane in read_exr(path).channels.items()}


@pytest.mark.parametrize("l_white", [10.0, 20.0, 100.0])
def test_a_ramp_of_all_codes_equals_the_solved_eq11(tmp_path: Path, l_white: float) -> None:
    clip = ramp_clip(tmp_path / "ramp.mkv")
    settings = make_settings(
        "paper", expand_map=False, transfer="srgb", l_max=20.0, l_white=l_white
    )
    convert(clip, tmp_path / "out", settings)
    l_d = srgb_to_linear(CODES)
    root = np.sqrt((1 - l_d) ** 2 + 4 * l_d / l_white**2)
    # The published form cancels for dark codes, so the root's conjugate is used: same number.
    expected = 20 * l_white / 2 * (4 * l_d / l_white**2) / (1 - l_d + root)
    for name, plane in first_exr(tmp_path / "out").items():
        normal = expected > 6.2e-5  # below, a half has fewer bits than half precision
        np.testing.assert_allclose(
            plane[3][normal], expected[normal], rtol=1e-3, err_msg=f"channel {name}"
        )


def test_grey_stays_grey_and_hue_is_kept(tmp_path: Path) -> None:
    """Eq. 3: the three channels are multiplied by one number, so their ratios stay."""
    colours = np.array([[[200, 120, 40], [255, 255, 0], [10, 90, 240], [77, 77, 77]]], np.uint8)
    frame = np.repeat(np.repeat(colours, 24, axis=0), 8, axis=1)
    clip = write_ffv1(tmp_path / "c.mkv", [frame])
    settings = make_settings("paper", expand_map=False, transfer="srgb", l_max=20.0)
    convert(clip, tmp_path / "out", settings)
    out = first_exr(tmp_path / "out")
    linear = srgb_to_linear(colours[0])
    for i in range(4):
        x = 8 * i + 4
        rgb = np.array([out[c][12, x] for c in "RGB"])
        luminance = linear[i] @ (0.213, 0.715, 0.072)
        root = np.sqrt((1 - luminance) ** 2 + 4 * luminance / 400)
        gain = 200 * (4 / 400) / (1 - luminance + root)
        np.testing.assert_allclose(rgb, linear[i] * gain, rtol=1.5e-3, atol=1e-6)


@pytest.mark.parametrize("size", [(1, 1), (3, 2), (16, 4), (4096, 16)])
@pytest.mark.parametrize("code", [0, 255])
@pytest.mark.parametrize("preset", ["paper", "default"])
def test_black_white_and_odd_sizes_work(
    tmp_path: Path, size: tuple[int, int], code: int, preset: str
) -> None:
    width, height = size
    clip = write_ffv1(tmp_path / "c.mkv", [np.full((height, width, 3), code, np.uint8)] * 3)
    summary = convert(clip, tmp_path / "out", make_settings(preset))
    assert summary.written == 3
    for path in (tmp_path / "out").glob("*.exr"):
        for name, plane in read_exr(path).channels.items():
            assert plane.shape == (height, width)
            assert np.isfinite(plane.astype(np.float64)).all(), f"{name} is not finite"
            assert code or not plane.any(), "black must stay black"


def test_output_primaries_keep_white_white(tmp_path: Path) -> None:
    clip = write_ffv1(tmp_path / "c.mkv", [np.full((16, 16, 3), 255, np.uint8)])
    for primaries in ("rec709", "rec2020", "acescg", "aces2065-1"):
        settings = make_settings("paper", operator="linear", l_max=2.0, primaries=primaries)
        convert(clip, tmp_path / primaries, settings)
        for name, plane in first_exr(tmp_path / primaries).items():
            np.testing.assert_allclose(plane, 2, rtol=1e-3, err_msg=f"{primaries} {name}")


def test_layers_say_what_was_done(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    frame = rng.integers(0, 256, (48, 64, 3)).astype(np.uint8)
    clip = write_ffv1(tmp_path / "c.mkv", [frame])
    settings = make_settings(
        "paper", transfer="srgb", lights=64, layers=("expand_map", "gain", "clip_mask")
    )
    convert(clip, tmp_path / "out", settings)
    out = first_exr(tmp_path / "out")
    assert set(out) == {"R", "G", "B", "expand_map.Y", "gain.Y", "clip_mask.Y"}
    linear = srgb_to_linear(frame)
    np.testing.assert_allclose(out["R"], linear[..., 0] * out["gain.Y"], rtol=3e-3, atol=1e-6)
    assert (out["clip_mask.Y"] == (frame.max(axis=2) == 255)).all()


def test_the_layer_is_the_definition_of_the_map(tmp_path: Path) -> None:
    """512x288, lossless: design.md's definition read plainly in float64."""
    from itmo_video.expand_map.density import kernel_weight, scaled_radius_px, white_density
    from itmo_video.expand_map.median_cut import median_cut

    y, x = np.mgrid[0:288, 0:512]
    grey = 30 + 60 * np.exp(-((x - 100) ** 2 + (y - 90) ** 2) / 9000)
    for cx, cy in ((100, 80), (300, 200), (420, 60)):
        grey[np.hypot(x - cx, y - cy) < 14] = 255
    codes = np.round(grey).astype(np.uint8)
    clip = write_ffv1(tmp_path / "c.mkv", [np.dstack([codes] * 3)])
    settings = make_settings("paper", temporal="per-frame", transfer="srgb", layers=("expand_map",))
    convert(clip, tmp_path / "out", settings, RunOptions(jobs=1))
    got = first_exr(tmp_path / "out")["expand_map.Y"]

    lights = median_cut(srgb_to_linear(codes).astype(np.float32), 1024)
    r_t = scaled_radius_px(16, 512, 288)
    expected = np.zeros_like(got)
    for row in range(0, 288, 4):
        distance = np.hypot(lights.x[None] - np.arange(512)[:, None], lights.y[None] - row)
        near = distance <= r_t
        r_max = np.where(near, distance, 0).max(axis=1)
        weight = np.where(near, kernel_weight(np.where(near, distance, 0), r_max[:, None]), 0)
        density = (weight * lights.power).sum(axis=1)
        expected[row] = np.where(near.sum(axis=1) >= 4, density, 0) / white_density(r_t)
    expected = np.minimum(expected[::4], 1)
    np.testing.assert_allclose(got[::4], expected, atol=2e-3)
    assert expected.max() > 0.5, "the scene must have something to expand"


@pytest.mark.parametrize("preset", ["paper", "default"])
def test_a_panorama_has_no_seam(tmp_path: Path, preset: str) -> None:
    y, x = np.mgrid[0:256, 0:1024].astype(np.float64)
    frame = 40 + 20 * np.cos(x / 1024 * 2 * np.pi) + 10 * np.sin(y / 20)
    for cx in (0, 1024, 500):
        frame[np.hypot(x - cx, y - 128) < 40] = 255
    clip = write_ffv1(tmp_path / "c.mkv", [np.dstack([frame.astype(np.uint8)] * 3)])
    flags = {"projection": "latlong", "layers": ("expand_map",)}
    convert(clip, tmp_path / "out", make_settings(preset, **flags))
    weight = first_exr(tmp_path / "out")["expand_map.Y"]
    assert weight.max() > 0.5
    seam = np.abs(weight[:, 0] - weight[:, -1]).mean()
    assert seam < 0.02, f"the map's first and last columns differ by {seam:.3f}"
