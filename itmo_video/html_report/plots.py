"""Plots as SVG text; curves differ by dash pattern as well as by colour (Okabe and Ito 2008)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

WIDTH, HEIGHT = 960, 240
LEFT, RIGHT, TOP, BOTTOM = 64, 12, 12, 30
STYLES = (
    ("#f0e442", ""), ("#56b4e9", "7 3"), ("#e69f00", "2 3"), ("#009e73", "10 3 2 3"),
    ("#cc79a7", "4 2"), ("#d55e00", "1 2"),
)  # fmt: skip


@dataclass(frozen=True)
class Line:
    """One curve: a label and its values per frame."""

    label: str
    values: Sequence[float]


@dataclass(frozen=True)
class Plot:
    """Curves over frames: `numbers` label the axis, `cuts` and `keys` are positions in them."""

    title: str
    unit: str
    lines: Sequence[Line]
    numbers: Sequence[int]
    cuts: Sequence[int] = field(default_factory=tuple)
    keys: Sequence[int] = field(default_factory=tuple)
    is_log: bool = False
    top: float | None = None


@dataclass(frozen=True)
class Drawn:
    """A plot in the form that the template draws: coordinates in a box of WIDTH by HEIGHT."""

    title: str
    summary: str
    curves: list[tuple[str, str, str, str]]  # label, colour, dash, points
    y_ticks: list[tuple[float, str]]
    x_ticks: list[tuple[float, str]]
    cuts: list[float]
    keys: list[float]


def draw(plot: Plot) -> Drawn:
    """The coordinates and ticks of a plot."""
    values = [v for line in plot.lines for v in line.values if math.isfinite(v)]
    largest = max(plot.top or 0.0, max(values, default=0.0))
    if plot.is_log:
        high = math.ceil(math.log10(max(largest, 1)) * 3) / 3
        low = -2.0
        ticks = [float(t) for t in range(int(low), math.floor(high) + 1)]
        named = [(t, f"{10**t:g}") for t in ticks]
    else:
        low, even = 0.0, even_ticks(largest or 1.0)
        high, named = even[-1], [(t, f"{t:.3g}") for t in even]

    def y(value: float) -> float:
        shown = math.log10(max(value, 10**low)) if plot.is_log else value
        part = (shown - low) / (high - low)
        return round(TOP + (1 - min(max(part, 0), 1)) * (HEIGHT - TOP - BOTTOM), 1)

    curves = []
    for line, (colour, dash) in zip(plot.lines, STYLES, strict=False):
        points = " ".join(f"{x_of(i, len(plot.numbers))},{y(v)}" for i, v in enumerate(line.values))
        curves.append((line.label, colour, dash, points))
    count = len(plot.numbers)
    every = max(1, math.ceil(count / 10))
    told = "; ".join(
        f"{line.label} {min(line.values):.3g} to {max(line.values):.3g}" for line in plot.lines
    )
    return Drawn(
        f"{plot.title} ({plot.unit})",
        f"{plot.title}, {plot.unit}: {told}",
        curves,
        [(round(TOP + (1 - (t - low) / (high - low)) * (HEIGHT - TOP - BOTTOM), 1), text)
         for t, text in named],
        [(x_of(i, count), str(plot.numbers[i])) for i in range(0, count, every)],
        [x_of(i, count) for i in plot.cuts],
        [x_of(i, count) for i in plot.keys],
    )  # fmt: skip


def even_ticks(largest: float) -> list[float]:
    """Ticks from 0 to `largest` (> 0) or just above, in up to 4 steps of 1, 2, 2.5 or 5."""
    least = largest / 4
    power = 10.0 ** math.floor(math.log10(least))
    step = next(m * power for m in (1, 2, 2.5, 5, 10) if m * power >= least * (1 - 1e-9))
    return [step * i for i in range(math.ceil(largest / step - 1e-9) + 1)]


def x_of(position: int, count: int) -> float:
    """The horizontal position of a frame in a plot."""
    return round(LEFT + position / max(1, count - 1) * (WIDTH - LEFT - RIGHT), 1)


def bars(shares: Sequence[float], lowest: int, bins_a_unit: int) -> list[dict[str, object]]:
    """A histogram's bars: x, y, width, height, and a tooltip."""
    filled = [i for i, share in enumerate(shares) if share > 0]
    if not filled:
        return []
    first, last = filled[0], filled[-1]
    step = (WIDTH - LEFT - RIGHT) / (last - first + 1)
    top = max(shares)
    out: list[dict[str, object]] = []
    for i in range(first, last + 1):
        height = round(shares[i] / top * (HEIGHT - TOP - BOTTOM), 1)
        stop = lowest + i / bins_a_unit
        out.append({
            "x": round(LEFT + (i - first) * step, 1), "y": round(HEIGHT - BOTTOM - height, 1),
            "width": round(max(1.0, step - 2), 1), "height": height, "is_over_white": stop >= 0,
            "tick": ("\u2264 " if i == 0 else "") + f"{stop:+g}" if stop == int(stop) else "",
            "share": f"{shares[i]:.2%}",
            "says": f"{stop:+g} to {stop + 1 / bins_a_unit:+g} stops: {shares[i]:.3%} of pixels",
        })  # fmt: skip
    return out
