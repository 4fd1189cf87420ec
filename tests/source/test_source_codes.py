"""Codes through a file: bars of every matrix and range, and codes that deny their tags."""

from __future__ import annotations

from pathlib import Path

import av
import numpy as np
import pytest
from clips import film_encoding
from source_clips import write_packed, write_planes

from itmo_video.colour import linear_light
from itmo_video.colour.transfer import eotf
from itmo_video.source import planes
from itmo_video.source.code_range import outside_range
from itmo_video.source.opening import open_clip

BARS = np.array(
    [[1, 1, 1], [0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [0, 1, 1], [1, 0, 1],
     [0.5, 0.5, 0.5], [0.75, 0.25, 0.1], [0.02, 0.03, 0.01]]
)  # fmt: skip
KR_KB = {"bt709": (0.2126, 0.0722), "bt601": (0.299, 0.114), "bt2020": (0.2627, 0.0593)}
NUMBER = {"bt709": 1, "bt601": 6, "bt2020": 9}
COLOUR = ("matrix", "range", "transfer", "primaries")


@pytest.mark.parametrize("layout", ["420", "422", "444"])
@pytest.mark.parametrize(("matrix", "range_", "depth"), [
    ("bt709", "limited", 8), ("bt709", "full", 8), ("bt601", "limited", 8), ("bt601", "full", 8),
    ("bt2020", "limited", 10), ("bt709", "limited", 12),
])  # fmt: skip
def test_bars_come_out_right(
    tmp_path: Path, layout: str, matrix: str, range_: str, depth: int
) -> None:
    kr, kb = KR_KB[matrix]
    luma = BARS @ [kr, 1 - kr - kb, kb]
    ycc = np.stack(
        [luma, (BARS[:, 2] - luma) / 2 / (1 - kb), (BARS[:, 0] - luma) / 2 / (1 - kr)], 1
    )
    step, top = 2 ** (depth - 8), 2**depth - 1
    spans = np.array([219, 224, 224]) * step if range_ == "limited" else np.array([top] * 3)
    base = np.array([16 if range_ == "limited" else 0, 128, 128]) * step
    codes = np.clip(np.round(ycc * spans + base), 0, top)
    stored = (codes - base) / spans  # what the codes say exactly; quantised, so not BARS
    red = stored[:, 0] + 2 * (1 - kr) * stored[:, 2]
    blue = stored[:, 0] + 2 * (1 - kb) * stored[:, 1]
    green = (stored[:, 0] - kr * red - kb * blue) / (1 - kr - kb)
    want = np.clip(np.stack([red, green, blue], 1), 0, 1) ** 2.4

    wide = np.repeat(codes, 16, axis=0).astype(np.uint8 if depth == 8 else np.uint16)
    full = [np.tile(wide[:, i], (32, 1)) for i in range(3)]
    across, down = {"420": (2, 2), "422": (2, 1), "444": (1, 1)}[layout]
    code_planes = [full[0], *(p[::down, ::across].copy() for p in full[1:])]
    path = write_planes(
        tmp_path / "bars.mkv",
        f"yuv{layout}p" + ("" if depth == 8 else f"{depth}le"),
        code_planes,
        colorspace=NUMBER[matrix],
        color_range={"limited": 1, "full": 2}[range_],
        color_trc=1,
        color_primaries=1,
    )
    frame = next(open_clip(path).frames())
    enc = frame.encoding
    assert (enc.matrix, enc.range, enc.bit_depth, enc.transfer) == (matrix, range_, depth, "bt1886")
    siting = {"siting": "assumed"} if layout == "420" else {}  # FFV1 does not state it
    assert enc.origins == dict.fromkeys(COLOUR, "tag") | siting
    for plane, codes_in in zip(frame.planes, code_planes, strict=True):
        np.testing.assert_array_equal(plane, codes_in)
    got = np.stack(linear_light.to_rgb_linear(frame, clip=True), -1)
    for i in range(len(BARS)):
        inner = got[4:-4, 16 * i + 4 : 16 * i + 12]
        np.testing.assert_allclose(inner, np.broadcast_to(want[i], inner.shape), atol=1 / 1023)
    np.testing.assert_allclose(got[4:-4, 4:12], 1, atol=0.001)


def test_rgb_bars_are_exact(tmp_path: Path) -> None:
    codes = np.repeat(np.round(BARS * 255).astype(np.uint8), 4, axis=0)
    rgb = np.tile(codes, (8, 1, 1))
    packed = np.dstack([rgb[..., ::-1], np.zeros(rgb.shape[:2], np.uint8)]).reshape(len(rgb), -1)
    path = write_packed(tmp_path / "rgb.mkv", "bgr0", packed, rgb.shape[1])
    frame = next(open_clip(path).frames())
    assert (frame.encoding.family, frame.encoding.transfer) == ("rgb", "srgb")
    got = np.stack(linear_light.to_rgb_linear(frame, clip=True), -1)
    np.testing.assert_allclose(got, eotf(rgb / 255, "srgb"), atol=1e-6)


@pytest.mark.parametrize(("bars", "inside", "told"), [(0, 3, True), (16, 90, False), (16, 3, True)])
def test_bars_of_code_0_do_not_ask_for_full_range(bars: int, inside: int, told: bool) -> None:
    luma = np.full((96, 160), 90, np.uint8)
    luma[:8], luma[8:12, 16:-16] = 90, inside
    luma[:, :bars] = luma[:, 160 - bars :] = 0
    picture = planes.Picture("ycbcr", 8, False, (luma, *[np.full((48, 80), 128, np.uint8)] * 2))
    encoding = film_encoding()
    assert bool(outside_range(picture, encoding)) == told


def test_codes_outside_the_tagged_range_are_told(tmp_path: Path) -> None:
    path = tmp_path / "a.mkv"
    with av.open(str(path), "w") as film:
        stream = film.add_stream("ffv1", rate=25)
        stream.width, stream.height, stream.pix_fmt = 64, 10, "yuv420p"
        frame = av.VideoFrame(64, 10, "yuv420p")
        luma = np.full((10, frame.planes[0].line_size), 100, np.uint8)
        luma[0] = 250
        frame.planes[0].update(luma.tobytes())
        for plane in frame.planes[1:]:
            plane.update(bytes([128]) * plane.buffer_size)
        frame.color_range, frame.pts = 1, 0
        film.mux(stream.encode(frame))
        film.mux(stream.encode())
    notices = open_clip(path).info.notices
    assert any("10.0 % of the first frame's codes" in notice for notice in notices)
