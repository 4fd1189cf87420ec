"""The operator `auto` does not paint: no specks, and no edge of colour that is not in the source.

Made pictures as cameras record them, with noise that decides which pixel stands at white. Distances
are in u'v' of CIE 1976.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from itmo_video.operators import auto, auto_parting
from itmo_video.operators.base import Context

Picture = npt.NDArray[Any]

PEAK = 1000 / 203
XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])


def uv(rgb: Picture) -> Picture:
    """CIE 1976 u'v' of linear BT.709: (H, W, 2)."""
    x, y, z = np.moveaxis(rgb @ XYZ.T, -1, 0)
    return np.asarray(np.stack([4 * x, 9 * y], -1) / (x + 15 * y + 3 * z + 1e-6)[..., None])


def coded(light: Picture, seed: int, noise: float) -> Picture:
    """Light as 8 bits hold it, with each channel's own noise, halved in chroma as video's is."""
    rng = np.random.default_rng(seed)
    height, width = light.shape[:2]
    luma = rng.normal(0, noise, (height, width, 1))
    small = rng.normal(0, noise, (height // 2, width // 2, 3)).astype(np.float32)
    chroma = cv2.resize(small, (width, height), interpolation=cv2.INTER_NEAREST)
    code = np.clip(light, 0, 1) ** (1 / 2.4) + luma + chroma
    return np.asarray(((np.rint(255 * np.clip(code, 0, 1)) / 255) ** 2.4).astype(np.float32))


def expanded(picture: Picture, hue: str = "restore") -> Picture:
    """The picture by its own maps: (H, W, 3)."""
    context = Context(PEAK, PEAK, hue=hue)
    maps = [
        np.ascontiguousarray(part) for part in np.moveaxis(auto.map_auto(picture, context), -1, 0)
    ]
    planes = [np.ascontiguousarray(plane) for plane in np.moveaxis(picture, -1, 0)]
    return np.asarray(picture * np.dstack(auto.gain_auto(planes, None, maps, context)))


def specks(picture: Picture, result: Picture) -> Picture:
    """How far each pixel's hue moved apart from how those around it did."""
    move = (uv(result) - uv(picture)).astype(np.float32)
    around = np.dstack([cv2.medianBlur(np.ascontiguousarray(move[..., i]), 5) for i in (0, 1)])
    return np.asarray(np.hypot(*np.moveaxis(move - around, -1, 0)))


def new_edges(picture: Picture, result: Picture) -> Picture:
    """Steps of hue from pixel to pixel beyond the picture's own, along rows."""
    before, after = (
        np.hypot(*np.moveaxis(np.diff(uv(p), axis=1), -1, 0)) for p in (picture, result)
    )
    return np.asarray(np.maximum(after - 1.5 * before, 0))


def lamp() -> Picture:
    """A warm street lamp on a bright wall: its core clips, green and blue here and there."""
    y, x = np.mgrid[0:96, 0:160]
    away = np.hypot(y - 48, x - 80)
    light = 0.05 + 1.05 / (1 + np.exp((away - 12) / 1.5)) + 0.25 * np.exp(-away / 25)
    return np.asarray(light[..., None] * np.array([1.1, 0.85, 0.68]))


def sky() -> Picture:
    """A plain blue sky that brightens to the right until its blue clips."""
    bright = np.linspace(0.8, 1.25, 160)[None, :, None] * np.ones((96, 1, 1))
    return np.asarray(bright * np.array([0.72, 0.8, 1.0]))


@pytest.mark.parametrize("seed", [0, 1])
def test_no_specks_beside_a_lamp(seed: int) -> None:
    picture = coded(lamp(), seed, 0.008)
    result = expanded(picture)
    assert result.max() > 1.2, "the lamp is restored"
    assert specks(picture, result).max() < 0.005
    assert new_edges(picture, result).max() < 0.006


def test_a_single_pixel_at_white_hardly_separates() -> None:
    """By a quarter of what it would among its like, as do no others by more."""
    lone, many = np.full((2, 9, 200, 3), (0.88, 0.8, 0.7), np.float32)
    many[2:7, 2:7, 0] = many[4, 60:140, 0] = lone[4, 4, 0] = 1  # a line ends in other blocks of 64
    maps = [np.full((9, 200), level, np.float32) for level in (0.5, 0.2, 0.1, 0)]

    def separation(picture: np.ndarray) -> np.ndarray:
        planes = [np.ascontiguousarray(plane) for plane in np.moveaxis(picture, -1, 0)]
        red, _, blue = auto.gain_auto(planes, None, maps, Context(PEAK, PEAK))
        return np.log2(red / blue)

    one, whole = separation(lone), separation(many)
    assert whole[4, 4] > 0.5
    assert np.isclose(one[4, 4], whole[4, 4] / 4, rtol=1e-4)
    assert np.isclose(whole[4, 100], whole[4, 4] / 2, rtol=1e-4)
    assert one.max() == one[4, 4]
    assert (one[0] == 0).all()
    assert (whole[:, 150:] == 0).all()


@pytest.mark.parametrize("seed", [0, 1])
def test_no_edge_in_a_sky_whose_blue_clips(seed: int) -> None:
    picture = coded(sky(), seed, 0.004)
    result = expanded(picture)
    assert new_edges(picture, result).max() < 0.002
    assert specks(picture, result).max() < 0.002


def test_no_holes_in_a_white_sky_that_compression_let_waver() -> None:
    """Some blocks of it stand at white and some a little below: they are lifted alike."""
    rng = np.random.default_rng(3)
    blocks = np.repeat(np.repeat(rng.choice([0.955, 0.99, 1.0], (24, 40)), 4, 0), 4, 1)
    picture = coded(blocks[..., None] * np.ones(3), 0, 0.002)
    stops = np.log2(expanded(picture)[..., 1] / picture[..., 1])
    assert np.abs(np.diff(stops, axis=1)).max() < 0.35


def test_channels_part_where_one_has_clipped_throughout() -> None:
    stops = np.full((64, 96, 3), (0.5, 0.2, 0.0), np.float32)
    picture = np.full((64, 96, 3), (1.0, 0.7, 0.3), np.float32)
    no_loss = np.zeros_like(stops)
    assert np.allclose(auto_parting.decided_together(stops, picture, no_loss), stops, atol=0.02)
    picture[::2, ::3, 0] = 0.94  # as often below white as at it
    picture[1::2, 1::3, 0] = 0.94
    together = auto_parting.decided_together(stops, picture, no_loss)[8:-8, 8:-8]
    assert np.ptp(together, axis=-1).max() < 0.1
    assert np.allclose(together.mean(), 0.213 * 0.5 + 0.715 * 0.2, atol=0.03)


def test_no_patches_where_a_second_channel_is_coded_in_blocks_near_white() -> None:
    """A pale sky whose blue clips and whose red stands at 0.9 or 0.95, by coding blocks."""
    rng = np.random.default_rng(1)
    red = np.repeat(np.repeat(rng.choice([0.9, 0.95], (6, 10)), 16, 0), 16, 1)
    picture = np.dstack([red, 0.77 * np.ones_like(red), np.ones_like(red)]).astype(np.float32)
    levels = np.full(picture.shape, (0.02, 0.0, 0.35), np.float32)  # blue rises by 0.8 stops
    colour = auto_parting.colour_of_bright(picture)
    bounded = auto_parting.bounded_parting(levels, colour, 0 * levels, np.log2(PEAK))
    planes, maps = (
        [np.ascontiguousarray(plane) for plane in np.moveaxis(planes, -1, 0)]
        for planes in (picture, np.dstack([bounded, np.zeros_like(red, np.float32)]))
    )
    result = picture * np.dstack(auto.gain_auto(planes, None, maps, Context(PEAK, PEAK)))
    assert new_edges(picture, result).max() < 0.006
    assert np.abs(uv(result) - uv(picture)).max() < 0.035


def test_a_saturated_colour_may_part_further_and_two_clipped_channels_are_free() -> None:
    levels = np.full((48, 64, 3), (0.5, 0.1, 0.0), np.float32)
    for colour, parted_stops in (
        ((1.0, 1.0, 1.0), 0.5 * 3),  # what is white tells nothing of the colour
        ((1.0, 0.5, 0.5), 0.5),  # one stop
        ((1.0, 0.5, 2**-1.5), 0.5 * 1.5**1.5),
        ((1.0, 1.0, 0.25), 0.5 * 3),
    ):
        picture = np.full(levels.shape, colour, np.float32)
        bounded = auto_parting.bounded_parting(levels, picture, 0 * levels, 3.0) * 3
        assert np.allclose(bounded[..., 0] - bounded[..., 2], parted_stops, atol=1e-3), colour


def wall(bright: float) -> Picture:
    """A bluish wall of two bright halves, the right one `bright` times the left one."""
    light = np.where(np.arange(160) < 80, 0.55, 0.55 * bright)[None, :, None]
    return np.asarray(light * np.array([0.76, 0.84, 1.0]) * np.ones((96, 1, 1)), np.float32)


def test_a_lost_colour_is_what_did_not_clip_around_has_more_of() -> None:
    picture = np.minimum(wall(2), 1)
    lost = auto_parting.colour_lost(picture, auto_parting.colour_of_bright(picture))
    assert np.allclose(lost[40:56, 86, 2], np.log2(0.55 * 2), atol=0.02), "blue's own"
    assert lost[..., :2].max() < 1e-3, "red and green did not clip"
    assert lost[:, 150].max() < 0.01, "all around is clipped: nothing tells"


def test_a_white_thing_before_coloured_ones_loses_no_colour() -> None:
    picture = np.full((96, 160, 3), (0.25, 0.5, 0.1), np.float32)  # leaves, and sky between them
    picture[::8, ::8] = picture[1::8, ::8] = picture[::8, 1::8] = 1
    lost = auto_parting.colour_lost(picture, auto_parting.colour_of_bright(picture))
    assert lost[picture.min(-1) == 1].max() < 0.02


def test_an_undecided_place_parts_by_what_it_lost_and_is_as_bright() -> None:
    picture = np.full((64, 96, 3), 0.85, np.float32)  # bright, and nothing clips throughout
    stops, lost = np.zeros((2, 64, 96, 3), np.float32)
    stops[..., 2], lost[..., 2] = 0.5, 0.2
    together = auto_parting.decided_together(stops, picture, lost)
    assert np.allclose(together[..., 2] - together[..., 0], 0.2, atol=1e-5)
    luminance = together @ np.array((0.213, 0.715, 0.072))
    assert np.allclose(luminance, 0.072 * 0.5, atol=1e-5)


def test_hue_keep_moves_none() -> None:
    picture = coded(lamp(), 0, 0.008)
    moved = np.abs(uv(expanded(picture, "keep")) - uv(picture))
    assert moved[picture.max(-1) > 0.02].max() < 1e-4
