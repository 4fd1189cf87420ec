"""The frame rate of a stream by its time stamps, and notices about them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np
import numpy.typing as npt

from itmo_video import words
from itmo_video.model import ASSUMED_STREAM_RATE
from itmo_video.source.chroma_siting import Y4M
from itmo_video.source.decoding import Losses
from itmo_video.source.packets import Packets, packet_step
from itmo_video.words import counted

# Streams without a container, whose frames FFmpeg counts at 25 a second whatever they state.
_UNTIMED = (
    "h264", "hevc", "vvc", "evc", "obu", "av1", "m4v", "mpegvideo", "vc1", "h263", "h261", "dirac",
    "cavsvideo", "mjpeg", "mpjpeg", "mjpeg_2000", "ingenient",
)  # fmt: skip
_Y4M_RATE = re.compile(rb"YUV4MPEG2[^\n]* F0*[1-9]\d*:0*[1-9]")


def stated_rate(stream: Any, head: bytes = b"") -> Fraction | None:
    """The frame rate that an open stream states, None if none; `head` is a Y4M's first line."""
    name = str(stream.container.format.name)
    if name in _UNTIMED:
        rate = stream.codec_context.framerate
    elif name == Y4M and _Y4M_RATE.match(head) is None:
        rate = None
    else:
        rate = stream.average_rate or stream.guessed_rate
    return Fraction(rate) if rate else None


def timing(
    stream: Any, stated: Fraction | None, packets: Packets, time_base: Fraction
) -> tuple[Fraction, Fraction, bool]:
    """The frame rate, the length in seconds, and whether the rate varies."""
    rate = stated or ASSUMED_STREAM_RATE
    count = len(packets.pts)
    step = packet_step(packets.pts) if packets.is_exact else None
    if step is None:
        return rate, count / rate, False
    measured = 1 / (step * time_base)
    rate = rate if 0.8 < rate / measured < 1.25 or rate < measured else measured
    length = (packets.pts[-1] - packets.pts[0] + step) * time_base
    # In a truncated file, some frames shown before the last ones are missing.
    whole = packets.pts[:-16] if count > 48 or (packets.declared or 0) > count else packets.pts
    steps = np.diff(np.asarray(whole, np.int64))
    # Matroska counts in milliseconds, so intervals at a constant rate differ by one.
    if steps.size == 0:
        return rate, length, False
    if int(np.ptp(steps)) <= max(1, step // 50):
        rates = (rate, stream.base_rate, stream.guessed_rate)
        return _constant([Fraction(one) for one in rates if one], steps, time_base), length, False
    rounded = _rounded_to_ms((stream.base_rate, stream.guessed_rate), whole, time_base)
    if rounded is not None:
        return rounded, length, False
    film = _pulled_down(steps, time_base)
    if film is not None:
        return film, count / film, True
    length += ((packets.last_length or step) - step) * time_base
    return count / length, length, True  # the mean, so that a sequence lasts as long as the clip


def _constant(stated: Sequence[Fraction], steps: npt.NDArray[Any], time_base: Fraction) -> Fraction:
    """The first stated rate that agrees with the time stamps, or else the rate by time stamps.

    A container's mean rate includes its last frame's duration, which edits may leave at any value.
    """
    span, differ = int(steps.sum()), int(np.ptp(steps))
    for rate in stated:
        if abs(len(steps) / (rate * time_base) - span) <= max(1, differ):
            return rate
    return stated[0] if differ else 1 / (int(steps[0]) * time_base)


def _rounded_to_ms(
    stated: Sequence[Any], pts: Sequence[int], time_base: Fraction
) -> Fraction | None:
    """The stated constant rate whose times are these to a millisecond, None if there is none.

    Matroska counts in milliseconds, and remuxed to MP4 or MPEG-TS its stamps stay so.
    """
    for rate in (Fraction(one) for one in stated if one):
        regular = np.arange(len(pts)) * float(1 / (rate * time_base))
        differences = np.asarray(pts, np.int64) - pts[0] - regular
        if float(np.ptp(differences)) * time_base <= Fraction(1, 1000) + time_base:
            return rate
    return None


def _pulled_down(steps: npt.NDArray[Any], time_base: Fraction) -> Fraction | None:
    """The rate of film in 3:2 pulldown, None for anything else."""
    short, long = int(steps.min()), int(steps.max())
    is_near = np.minimum(np.abs(steps - short), np.abs(steps - long)) <= max(1, short // 50)
    part = float(np.mean(np.abs(steps - short) < np.abs(steps - long)))
    if abs(3 * short - 2 * long) > long // 20 or not is_near.all() or not 0.4 < part < 0.6:
        return None
    rate = 2 / ((short + long) * time_base)
    known = (Fraction(24000, 1001), Fraction(24), Fraction(25))
    return min(known, key=lambda one: abs(one - rate)) if rate < 26 else rate


def timing_notices(
    stream: Any, stated: Fraction | None, packets: Packets, rate: Fraction, is_vfr: bool
) -> list[str]:
    """Notices about an assumed rate, a variable rate and a truncated file."""
    told = []
    is_timed = str(stream.container.format.name) not in (*_UNTIMED, Y4M)
    if stated is None and not (is_timed and packets.is_exact and len(packets.pts) > 1):
        told.append(
            f"no frame rate is stated: assumed {rate} fps (if it is another, state it: "
            "ffmpeg -r RATE -i IN -c:v ffv1 OUT.mkv)"
        )
    if is_vfr:
        told.append(
            "variable frame rate: each frame keeps its own time; framesPerSecond is the mean, "
            f"{float(rate):.4g} (use --fps N for a constant rate)"
        )
    missing = (packets.declared or 0) - len(packets.pts)
    if missing > 0:
        told.append(f"truncated or damaged: {words.missing(missing, 'frame')}")
    return told


def packet_notices(packets: Packets, losses: Losses) -> list[str]:
    """Notices about irregularities of a stream's packets."""
    told: list[str] = []
    if packets.has_jumps:
        told.append("time stamps jump, as in joined captures: made continuous")
    elif not packets.is_exact:
        told.append("time stamps are incomplete: frames are counted from the start")
    if losses.missing:
        told.append(
            f"damaged: {counted(losses.packets, 'packet')} gave only "
            f"{counted(len(packets.pts), 'frame')}; what follows the damage may be numbered too low"
        )
    if packets.repeats:
        told.append(
            f"{counted(len(packets.repeats), 'empty chunk')}: each repeats the previous frame"
        )
    if packets.left_out:
        told.append(
            "starts in the middle of a group of pictures: "
            f"{counted(packets.left_out, 'frame')} before the first complete one left out"
        )
    return told
