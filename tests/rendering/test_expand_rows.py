"""The compiled pass from codes to halves gives the bytes of its steps, each a kernel of its own."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from clips import film_encoding
from compiled_kernels import loaded, needs_kernels

from itmo_video import make_settings
from itmo_video.colour.analysis_picture import analysis_guide
from itmo_video.colour.linear_light import strip_to_rgb_linear
from itmo_video.colour.strips import strip_buffers
from itmo_video.look import context_of, make_look
from itmo_video.model import Float32, Frame, Half
from itmo_video.operators import Context
from itmo_video.operators.protocol import ExpandsCodes
from itmo_video.rendering.guidance import Guidance
from itmo_video.rendering.rows import expand_in_steps, expand_rows

# (chroma's factors across and down, its siting, bits of a code, range)
KINDS: list[tuple[tuple[int, int], Any, int, Any]] = [
    ((2, 2), "left", 8, "limited"),
    ((2, 2), "topleft", 10, "limited"),
    ((2, 2), "center", 12, "full"),
    ((2, 1), "left", 8, "full"),
    ((1, 1), "left", 10, "limited"),
]
SIZES = [(70, 128), (33, 131), (16, 7)]


def picture(size: tuple[int, int], kind: tuple[tuple[int, int], Any, int, Any]) -> Frame:
    """Dark above, codes of all kinds below, whites and colours at white at the bottom."""
    (across, down), siting, bits, range_ = kind
    height, width = size
    rng = np.random.default_rng(3)
    dtype: Any = np.uint8 if bits == 8 else np.uint16
    luma: Any = rng.integers(0, 2**bits, size).astype(dtype)
    luma[: height // 3] //= 4
    luma[-height // 3 :] = (0.9 * 2**bits + luma[-height // 3 :] / 16).astype(dtype)
    chroma: list[Any] = [
        rng.integers(0.4 * 2**bits, 0.6 * 2**bits, (-(-height // down), -(-width // across)))
        for _ in range(2)
    ]
    encoding = film_encoding(bit_depth=bits, siting=siting, code_range=range_)
    return Frame(0, Fraction(0), (luma, *(c.astype(dtype) for c in chroma)), encoding)


def both(frame: Frame, maps: npt.NDArray[np.float32] | None, strength: float, **given: Any) -> None:
    """Hold the pass against its steps, by strips of 32 rows and as a whole: no strip shows."""
    look = make_look(make_settings("default", map_width=16, **given))
    assert isinstance(look.operator, ExpandsCodes)
    guide = analysis_guide(frame, 16)
    guidance = Guidance(frame, guide, look.settings, maps, False, look.operator.guard)
    context = context_of(None, look)
    width, height = frame.size
    out = np.full((2, 3, height, width), 7, np.float16)
    for top in range(0, height, 32):
        rows = slice(top, min(top + 32, height))
        for into, how in zip(out, (expand_rows, expand_in_steps), strict=True):
            how(frame, rows, guidance, look.operator, context, strength, into[:, rows])
    assert np.array_equal(*out.view(np.uint16))
    for how in (expand_rows, expand_in_steps):
        how(frame, slice(0, height), guidance, look.operator, context, strength, out[1])
        assert np.array_equal(*out.view(np.uint16))


@needs_kernels
@pytest.mark.parametrize("size", SIZES, ids=str)
@pytest.mark.parametrize("kind", KINDS, ids=str)
@pytest.mark.parametrize("zero", [(), (0,), (3,), (0, 1, 2), (0, 1, 2, 3)], ids=str)
def test_one_pass_gives_the_bytes_of_its_steps(
    size: tuple[int, int], kind: Any, zero: tuple[int, ...]
) -> None:
    frame = picture(size, kind)
    small = (*analysis_guide(frame, 16).shape, 4)
    maps = np.random.default_rng(4).random(small, np.float32)
    maps[..., zero] = 0
    for strength, hue in ((1.0, "restore"), (0.6, "keep")):
        both(frame, maps, strength, hue=hue)


class Doubled:
    """An operator's way to halves, without a pass over codes."""

    reach_px = 0

    def expand(
        self,
        rgb: Sequence[Float32],
        ratio: Float32 | None,
        maps: Sequence[Float32],
        context: Context,
        strength: float,
        out: Half,
    ) -> None:
        """Twice the picture."""
        out[...] = np.stack(rgb) * np.float32(2)


@needs_kernels
def test_another_operator_keeps_its_own_gains() -> None:
    frame, look = picture((33, 131), KINDS[0]), make_look(make_settings("default", map_width=16))
    guidance = Guidance(frame, analysis_guide(frame, 16), look.settings, None, False)
    rows, out = slice(0, 33), np.zeros((3, 33, 131), np.float16)
    expand_rows(frame, rows, guidance, Doubled(), context_of(None, look), 1.0, out)
    light = strip_buffers(rows, 131)
    strip_to_rgb_linear(frame, rows, True, light)
    assert np.array_equal(out, (2 * np.stack(light)).astype(np.float16))


@needs_kernels
def test_without_maps_all_that_clips_goes_to_the_peak() -> None:
    both(picture((70, 128), KINDS[0]), None, 1.0)


@needs_kernels
def test_halves_by_the_processor_are_those_by_integers() -> None:
    """Every 997th float of both signs, and those around what a half can hold."""
    bits = np.arange(0, 0x7F800000, 997, dtype=np.uint32)
    bits = np.concatenate([bits, np.arange(0x477FE000, 0x47800010, dtype=np.uint32)])
    values = np.concatenate([bits, bits | np.uint32(0x80000000)]).view(np.float32)
    out = np.empty(values.shape, np.float16)
    assert loaded is not None
    loaded.itmo_halves(values, values.size, out)
    with np.errstate(over="ignore"):
        assert np.array_equal(out.view(np.uint16), values.astype(np.float16).view(np.uint16))
