"""Detects cuts and flashes, and places keyframes, from a bounded window of frames.

Keyframes are at `index % key_interval == 0`, on both sides of a cut and at the clip's last frame,
so any range finds the same ones.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import cv2
import numpy as np

from itmo_video.colour.analysis_picture import analysis_guide, grey_of
from itmo_video.model import Code, Float32, Frame
from itmo_video.motion.flow import motion_picture

CUT_REACH = 3  # frames to either side that decide about a cut; also the longest flash
CUT_DIFFERENCE = 0.045  # mean absolute difference of tiny pictures, 0 to 1
CUT_RATIO = 3.0  # ratio of a cut to the changes around it
FLASH_RATIO = 0.5  # alike again within reach: a flash, not a cut
TINY_SIZE = (32, 18)


class Seen(Protocol):
    """What cut detection needs of a frame: its index and its picture at TINY_SIZE, 0 to 1."""

    @property
    def index(self) -> int:
        """Index in presentation order."""

    @property
    def tiny(self) -> Float32:
        """Grey picture, float32."""


S = TypeVar("S", bound=Seen)


@dataclass(frozen=True)
class Analysed:
    """A frame with its luma at analysis size, as codes and in 8 bits, and for cuts and motion.

    Cuts are detected in `tiny`, motion in `motion` (`flow.motion_picture`).
    """

    frame: Frame
    guide: Float32
    grey: Code
    tiny: Float32
    motion: Code

    @property
    def index(self) -> int:
        """Index in presentation order."""
        return self.frame.index


@dataclass(frozen=True)
class Placed(Generic[S]):
    """A frame and its place: whether it starts or ends a shot, and whether it is a keyframe.

    A flash is not a source for its neighbours: it is a keyframe only at the end of a shot.
    """

    analysed: S
    starts_shot: bool
    ends_shot: bool
    is_key: bool
    is_flash: bool = False


def analyse_frame(frame: Frame, map_width: int) -> Analysed:
    """A frame with its pictures at analysis size, at most `map_width` wide."""
    guide = analysis_guide(frame, map_width)
    grey = grey_of(guide)
    tiny = cv2.resize(grey, TINY_SIZE, interpolation=cv2.INTER_AREA).astype(np.float32)
    return Analysed(frame, guide, grey, tiny / np.float32(255), motion_picture(grey))


def difference(a: Seen, b: Seen) -> float:
    """Mean absolute difference of two tiny pictures, 0 to 1; 1 across a gap in the numbering."""
    return float(cv2.norm(a.tiny, b.tiny, cv2.NORM_L1)) / a.tiny.size


def is_cut(window: Sequence[Seen], at: int) -> bool:
    """Whether `window[at]` starts a new shot; the window has CUT_REACH frames on either side.

    A cut stands out from the changes around it. It is a flash instead if a frame before it and a
    frame after it, at most CUT_REACH + 1 apart, are alike. A gap in the numbering (frames that
    cannot be decoded) always separates, because the motion across it is unknown.
    """
    if window[at].index != window[at - 1].index + 1:
        return True
    change = difference(window[at - 1], window[at])
    if change < CUT_DIFFERENCE:
        return False
    others = [
        difference(window[i - 1], window[i])
        for i in range(max(1, at - CUT_REACH), min(len(window), at + CUT_REACH + 1))
        if i != at
    ]
    if others and change < CUT_RATIO * float(np.median(others)):
        return False
    return not any(
        difference(window[a], window[b]) < FLASH_RATIO * change
        for a in range(max(0, at - CUT_REACH - 1), at)
        for b in range(at, min(len(window), a + CUT_REACH + 2))
        if (a, b) != (at - 1, at)
    )


def is_flash(window: Sequence[Seen], at: int) -> bool:
    """Whether `window[at]` differs from frames on both sides that resemble each other.

    These are at most CUT_REACH + 1 apart, the maximum length of a flash.
    """
    if window[at].index in (window[0].index, window[-1].index):
        return False
    for a in range(max(0, at - CUT_REACH), at):
        change = difference(window[a], window[at])
        if change < CUT_DIFFERENCE:
            continue
        for b in range(at + 1, min(len(window), a + CUT_REACH + 2)):
            back = difference(window[at], window[b])
            if difference(window[a], window[b]) < FLASH_RATIO * min(change, back):
                return True
    return False


def place(frames: Iterable[S], key_interval: int, start: int) -> Iterator[Placed[S]]:
    """Mark shots and keyframes; looks CUT_REACH + 1 frames ahead and CUT_REACH + 1 back.

    `start` is the index from which frames were requested: a first frame beyond it, or the clip's
    first, starts a shot.
    """
    window: deque[S] = deque()
    cuts: dict[int, bool] = {}
    source = iter(frames)
    done = False
    position = 0  # of the frame to be placed, within the window
    is_first = True
    flashes: dict[int, bool] = {}
    while True:
        while not done and len(window) - position <= CUT_REACH + 1:
            following = next(source, None)
            if following is None:
                done = True
            else:
                window.append(following)
        if position >= len(window):
            return
        current = window[position]
        if is_first:
            starts = start == 0 or current.index != start
        else:
            starts = _cut(window, position, cuts)
        ends = position + 1 >= len(window) or _cut(window, position + 1, cuts)
        first = max(0, position - CUT_REACH)
        view = [window[i] for i in range(first, min(len(window), position + CUT_REACH + 1))]
        flash = not starts and not ends and is_flash(view, position - first)
        flashes[current.index] = flash
        flashes.pop(current.index - CUT_REACH - 1, None)
        due = _is_key_due(current.index, flashes, key_interval)
        yield Placed(current, starts, ends, starts or ends or due, flash and not due)
        is_first = False
        position += 1
        while position > CUT_REACH + 1:
            cuts.pop(window.popleft().index, None)
            position -= 1


def _is_key_due(index: int, flashes: Mapping[int, bool], key_interval: int) -> bool:
    """Whether this is a keyframe: on the grid, or moved here from a flash within reach."""
    for back in range(CUT_REACH + 1):
        if (index - back) % key_interval == 0 and (not flashes[index] or back == CUT_REACH):
            return True
        if not flashes.get(index - back - 1, False):
            return False
    return False


def _cut(window: Sequence[Seen], at: int, cuts: dict[int, bool]) -> bool:
    index = window[at].index
    if index not in cuts:
        first = max(0, at - CUT_REACH - 1)
        view = [window[i] for i in range(first, min(len(window), at + CUT_REACH + 1))]
        cuts[index] = is_cut(view, at - first)
    return cuts[index]
