"""The scheduler: cuts and flashes, the absolute key grid, spans that pair every frame."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction

import numpy as np
import pytest
from clips import moving_scene, still_encoding

from itmo_video.model import Float32, Frame
from itmo_video.motion.cut_detection import Analysed, analyse_frame, difference, place
from itmo_video.motion.keyframes import Span, spans

GREY = still_encoding("grey")


def analysed(count: int, cuts: tuple[int, ...] = (), flash: tuple[int, ...] = ()) -> list[Analysed]:
    frames = []
    for n, rgb in enumerate(moving_scene(count, cuts=cuts)):
        grey = np.full(rgb.shape[:2], 250, np.uint8) if n in flash else rgb[..., 1].copy()
        frames.append(analyse_frame(Frame(n, Fraction(n, 24), (grey,), GREY), 512))
    return frames


def all_spans(
    frames: Sequence[Analysed], make_map: Callable[[Analysed], Float32], smooth: int
) -> list[Span]:
    with ThreadPoolExecutor(1) as pool:  # a single thread stops where one waits for a later task
        return list(spans(place(frames, 5, 0), make_map, smooth, 0, lambda frames: True, pool))


def shots(frames: list[Analysed]) -> list[int]:
    return [p.analysed.index for p in place(frames, 5, 0) if p.starts_shot]


@pytest.mark.parametrize("cuts", [(), (7,), (10,), (3, 20), (1,), (29,), (12, 13), (12, 14)])
def test_cuts_are_found_on_their_very_frame(cuts: tuple[int, ...]) -> None:
    assert shots(analysed(30, cuts)) == [0, *cuts]


@pytest.mark.parametrize("flash", [(8,), (8, 9), (8, 9, 10), (1,), (15, 20)])
def test_a_flash_is_not_a_cut(flash: tuple[int, ...]) -> None:
    assert shots(analysed(30, (), flash)) == [0], "a flash was taken for a cut"


def test_a_black_frame_between_two_shots_makes_two_cuts() -> None:
    frames = analysed(30, (15,))
    black = np.zeros_like(frames[0].grey)
    frames[14] = analyse_frame(Frame(14, Fraction(14, 24), (black,), GREY), 512)
    assert shots(frames) == [0, 14, 15]


def test_keys_stand_on_the_grid_at_cuts_and_on_the_last_frame() -> None:
    keys = [p.analysed.index for p in place(analysed(29, (12,)), 5, 0) if p.is_key]
    assert keys == [0, 5, 10, 11, 12, 15, 20, 25, 28]


def test_frames_that_do_not_decode_separate_shots() -> None:
    frames = [f for f in analysed(30) if f.index not in (13, 14)]
    placed = list(place(frames, 5, 0))
    assert [p.analysed.index for p in placed if p.starts_shot] == [0, 15]
    assert [p.analysed.index for p in placed if p.ends_shot] == [12, 29]


def test_every_frame_gets_the_keys_around_it_whatever_the_smoothing() -> None:
    frames = analysed(40, (12, 23))
    for smooth in (0, 1, 3):
        made: list[int] = []

        def make_map(a: Analysed, made: list[int] = made) -> Float32:
            made.append(a.index)
            return a.grey.astype(np.float32) / np.float32(255)

        out = all_spans(frames, make_map, smooth)
        rendered = [a.index for span in out for a in span.frames]
        assert rendered == list(range(40)), f"smoothing {smooth}: frames lost or out of order"
        assert len(made) == len(set(made)), "a key's map was made twice"
        for span in out:
            assert span.frames[0].index == span.left_index
            if span.right_index is None:
                assert len(span.frames) == 1, "frames behind a lone key have no right key"
            else:
                assert span.right_index == span.frames[-1].index + 1
                assert span.right_index not in (12, 23), "a span crosses a cut"


def test_smoothing_uses_a_fixed_number_of_neighbours() -> None:
    """A key beyond the reach changes nothing, one within it does."""
    frames = _small(analysed(60))
    base = {
        s.left_index: s.left[1].result() for s in all_spans(frames, lambda a: a.tiny * 0 + 1, 2)
    }

    def spiked(a: Analysed) -> Float32:
        return a.tiny * 0 + (2 if a.index == 30 else 1)

    changed = {s.left_index: s.left[1].result() for s in all_spans(frames, spiked, 2)}
    assert base.keys() == changed.keys()
    moved = [i for i in changed if float(np.ptp(changed[i])) > 0 or changed[i].flat[0] > 1 + 1e-6]
    assert moved == [20, 25, 30, 35, 40]


def _small(frames: list[Analysed]) -> list[Analysed]:
    out = []
    for f in frames:
        grey = (f.tiny * 255).astype(np.uint8)
        out.append(Analysed(f.frame, f.guide, grey, f.tiny, grey))
    return out


def test_difference_is_symmetric_and_zero_for_equal() -> None:
    a, b = analysed(2)
    assert difference(a, a) == 0
    assert difference(a, b) == difference(b, a) > 0


def test_spans_without_maps_have_none() -> None:
    frames = analysed(12, (7,))
    with ThreadPoolExecutor(1) as pool:
        found = list(spans(place(frames, 5, 0), None, 0, 0, lambda frames: True, pool))
    assert [a.index for span in found for a in span.frames] == list(range(12))
    with pytest.raises(ValueError, match="without maps"):
        found[0].left[1].result()
