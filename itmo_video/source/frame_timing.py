"""How fast a stream's frames follow each other, by their stamps; and what is said of stamps."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np
import numpy.typing as npt

from itmo_video import words
from itmo_video.source.packets import Packets, packet_step
from itmo_video.words import counted


def timing(stream: Any, packets: Packets, time_base: Fraction) -> tuple[Fraction, Fraction, bool]:
    """Frames a second, length in seconds, and whether the rate varies."""
    rate = Fraction(stream.average_rate or stream.guessed_rate or 25)
    count = len(packets.pts)
    step = packet_step(packets.pts) if packets.is_exact else None
    if step is None:
        return rate, count / rate, False
    measured = 1 / (step * time_base)
    rate = rate if 0.8 < rate / measured < 1.25 or rate < measured else measured
    length = (packets.pts[-1] - packets.pts[0] + step) * time_base
    # Where a file is cut off, its last frames lack some of those shown before them.
    whole = packets.pts[:-16] if count > 48 or (packets.declared or 0) > count else packets.pts
    steps = np.diff(np.asarray(whole, np.int64))
    # Matroska counts in whole milliseconds, so steps of a constant rate differ by one.
    if steps.size == 0:
        return rate, length, False
    if int(np.ptp(steps)) <= max(1, step // 50):
        stated = (rate, stream.base_rate, stream.guessed_rate)
        return _constant([Fraction(one) for one in stated if one], steps, time_base), length, False
    film = _pulled_down(steps, time_base)
    if film is not None:
        return film, count / film, True
    length += ((packets.last_length or step) - step) * time_base
    return count / length, length, True  # so that the sequence lasts as long as the clip


def _constant(stated: Sequence[Fraction], steps: npt.NDArray[Any], time_base: Fraction) -> Fraction:
    """The first stated rate at which frames come when their stamps say, or the stamps' own.

    A container's mean counts its last frame's length too, which cuts and edits leave as they may.
    """
    span, differ = int(steps.sum()), int(np.ptp(steps))
    for rate in stated:
        if abs(len(steps) / (rate * time_base) - span) <= max(1, differ):
            return rate
    return stated[0] if differ else 1 / (int(steps[0]) * time_base)


def _pulled_down(steps: npt.NDArray[Any], time_base: Fraction) -> Fraction | None:
    """The rate of film whose frames are shown for two and three fields in turn, None for others."""
    short, long = int(steps.min()), int(steps.max())
    is_near = np.minimum(np.abs(steps - short), np.abs(steps - long)) <= max(1, short // 50)
    part = float(np.mean(np.abs(steps - short) < np.abs(steps - long)))
    if abs(3 * short - 2 * long) > long // 20 or not is_near.all() or not 0.4 < part < 0.6:
        return None
    rate = 2 / ((short + long) * time_base)
    known = (Fraction(24000, 1001), Fraction(24), Fraction(25))
    return min(known, key=lambda one: abs(one - rate)) if rate < 26 else rate


def timing_notices(packets: Packets, rate: Fraction, is_vfr: bool) -> list[str]:
    """What is said of a rate that varies, and of a file that is cut short."""
    told = []
    if is_vfr:
        told.append(
            "its frame rate varies: each frame keeps its own time; framesPerSecond is the mean, "
            f"{float(rate):.4g} (--fps N makes it constant)"
        )
    missing = (packets.declared or 0) - len(packets.pts)
    if missing > 0:
        told.append(f"it is cut short: {words.missing(missing, 'frame')} at its end")
    return told


def packet_notices(packets: Packets) -> list[str]:
    """What is out of the ordinary about a stream's packets."""
    told: list[str] = []
    if packets.has_jumps:
        told.append("its time stamps jump, as of joined captures: made continuous")
    elif not packets.is_exact:
        told.append("its time stamps are incomplete: frames are counted from the start")
    if packets.repeats:
        told.append(
            f"{counted(len(packets.repeats), 'empty chunk')}: each repeats the frame before it"
        )
    if packets.left_out:
        told.append(
            "it begins within a group of pictures: what is shown before its first whole frame, "
            f"{counted(packets.left_out, 'frame')}, is left out"
        )
    return told
