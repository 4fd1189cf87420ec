"""Converts rows of a frame from codes to half floats, for operators that write halves."""

from __future__ import annotations

import ctypes

import numpy as np

from itmo_video.colour import linear_light
from itmo_video.colour.strips import strip_buffers, strips, with_reach
from itmo_video.kernels.dispatch import with_compiled_form
from itmo_video.model import Frame, Half
from itmo_video.operators.base import Context
from itmo_video.operators.protocol import ExpandsCodes, WritesHalves
from itmo_video.rendering.guidance import Guidance


def expand_in_steps(
    frame: Frame,
    rows: slice,
    guidance: Guidance,
    operator: WritesHalves,
    context: Context,
    strength: float,
    out: Half,
) -> None:
    """`expand_rows` with a separate kernel for each step, a strip at a time."""
    for inner in strips(rows.stop - rows.start):
        strip = slice(rows.start + inner.start, rows.start + inner.stop)
        wide, within = with_reach(strip, operator.reach_px, frame.size[1])
        rgb = strip_buffers(wide, frame.size[0])
        linear_light.strip_to_rgb_linear(frame, wide, True, rgb)
        maps, ratio = guidance.rows(wide)
        halves = np.empty((3, *rgb[0].shape), np.float16)
        operator.expand(rgb, ratio, maps, context, strength, halves)
        out[:, inner] = halves[:, within]


def _compiled_rows(
    loaded: ctypes.CDLL,
    frame: Frame,
    rows: slice,
    guidance: Guidance,
    operator: WritesHalves,
    context: Context,
    strength: float,
    out: Half,
) -> None:
    if isinstance(operator, ExpandsCodes):
        maps = guidance.small_maps(rows)
        codes = None if maps is None else linear_light.codes_to_light(frame, clip=True)
        if maps and codes and codes.exponent:
            operator.from_codes(loaded, frame.planes[:3], rows, codes, maps, context, strength, out)
            return
    expand_in_steps(frame, rows, guidance, operator, context, strength, out)


@with_compiled_form(_compiled_rows)
def expand_rows(
    frame: Frame,
    rows: slice,
    guidance: Guidance,
    operator: WritesHalves,
    context: Context,
    strength: float,
    out: Half,
) -> None:
    """Expand some rows of a frame, clipped to [0, 1]: halves into `out` (3, rows, W).

    The compiled form is one pass over the codes, with the same bytes, if the operator has one and
    light is a power of them.
    """
    expand_in_steps(frame, rows, guidance, operator, context, strength, out)
