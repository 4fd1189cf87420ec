"""The keyframe scheduler: smoothed maps, and the spans of frames between two keyframes.

Everything is decided from a bounded window of frames, so any range renders to the same bytes.
Maps and flows are computed in a pool while decoding continues; callers wait for those they need.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass

import numpy as np

from itmo_video.model import Code, Float32
from itmo_video.motion import flow as flow_room
from itmo_video.motion.cut_detection import CUT_REACH, Analysed, Placed


@dataclass(eq=False)
class Key:
    """A keyframe: its picture, its map, and flows to the neighbouring keyframes of its shot.

    `picture` is the one in which motion is estimated. The frame's codes are not kept.
    """

    index: int
    picture: Code
    raw_map: Future[Float32]
    to_previous: Future[Float32] | None = None
    to_next: Future[Float32] | None = None


@dataclass(frozen=True)
class Span:
    """Frames [key, ..., next key): the keyframes' pictures and maps, and the frames to render.

    `right` is None if the span is a single keyframe. `flashes` are the indices of frames that do
    not use the keyframes' maps.
    """

    left_index: int
    left: tuple[Code, Future[Float32]]
    right_index: int | None
    right: tuple[Code, Future[Float32]] | None
    frames: tuple[Analysed, ...]
    flashes: frozenset[int] = frozenset()


def lead_in(key_interval: int, smooth_keys: int) -> tuple[int, int]:
    """How far before a frame's grid position keyframes, and frames, are needed to reproduce it.

    A keyframe that falls on a flash moves on by up to CUT_REACH, so keyframes may be that much
    further apart than the grid, and one more may be needed; its new place needs two windows.
    """
    keys = (smooth_keys + 1) * (key_interval + CUT_REACH)
    return keys, keys + 2 * (CUT_REACH + 1)


def smooth_map(keys: Sequence[Key], at: int, reach: int) -> Float32:
    """A keyframe's map, averaged along motion with up to `reach` keyframes on either side.

    Weighted by how well each warped picture agrees with the keyframe's own; flows are composed
    from key to key. `keys` are neighbours in one shot, `at` the position of the one wanted.
    """
    centre = keys[at]
    total = centre.raw_map.result().copy()
    weight = np.ones(total.shape[:2], np.float32)
    for step in (-1, 1):
        flow: Float32 | None = None
        stop = max(-1, at - reach - 1) if step < 0 else min(len(keys), at + reach + 1)
        for i in range(at + step, stop, step):
            behind = keys[i - step]
            link = behind.to_previous if step < 0 else behind.to_next
            assert link is not None
            flow = link.result() if flow is None else flow_room.compose(flow, link.result())
            agreed = flow_room.agreement(centre.picture, keys[i].picture, flow)
            agreed = flow_room.weight_of(agreed, total)
            seen = flow_room.warp_map(keys[i].raw_map.result(), flow)
            flow_room.add_weighed(total, seen, agreed)
            weight += agreed
    total /= flow_room.spread(weight, total)
    return total


def spans(
    placed: Iterable[Placed[Analysed]],
    make_map: Callable[[Analysed], Float32] | None,
    smooth_keys: int,
    first_needed: int,
    is_wanted: Callable[[Sequence[Analysed]], bool],
    pool: Executor,
    find_flow: flow_room.FindFlow = flow_room.flow_px,
) -> Iterator[Span]:
    """Pair frames with the keyframes on either side, in order, computing each map once.

    Without `make_map` spans have no maps; requesting one raises ValueError. Maps are computed from
    keyframe `first_needed` on; earlier frames only determine where shots begin. Only spans with a
    frame that `is_wanted` are yielded. Work in the `pool` waits only for work submitted before, so
    a pool that starts its work in order cannot deadlock.
    """
    shot: list[Key] = []  # the shot's latest keyframes, oldest first
    waiting: list[tuple[Key, list[Placed[Analysed]]]] = []  # their maps wait for later keys
    smoothed: dict[int, Future[Float32]] = {}
    no_map: Future[Float32] = Future()
    no_map.set_exception(ValueError("these spans were requested without maps"))

    def smooth(key: Key) -> Future[Float32]:
        if make_map is None:
            return no_map
        if key.index not in smoothed:
            smoothed[key.index] = pool.submit(smooth_map, tuple(shot), shot.index(key), smooth_keys)
        return smoothed[key.index]

    def ready(count_ahead: int) -> Iterator[Span]:
        # A span is complete once smooth_keys keyframes follow its right one, or the shot ends.
        while len(waiting) >= 2 + count_ahead:
            (left, frames), (right, _) = waiting[0], waiting[1]
            if is_wanted([item.analysed for item in frames]):
                yield _span(left, smooth(left), frames, right, smooth(right))
            waiting.pop(0)
            smoothed.pop(left.index, None)
            while shot.index(left) > smooth_keys:
                shot.pop(0)

    for item in placed:
        if item.analysed.index < first_needed:
            continue
        if item.is_key:
            raw_map = pool.submit(make_map, item.analysed) if make_map else no_map
            key = Key(item.analysed.index, item.analysed.motion, raw_map)
            if shot and smooth_keys:
                key.to_previous = pool.submit(find_flow, key.picture, shot[-1].picture)
                shot[-1].to_next = pool.submit(find_flow, shot[-1].picture, key.picture)
            shot.append(key)
            waiting.append((key, [item]))
            yield from ready(smooth_keys)
        elif waiting:
            waiting[-1][1].append(item)
        if item.ends_shot:
            yield from ready(0)
            while waiting:
                left, frames = waiting.pop(0)
                if is_wanted([item.analysed for item in frames]):
                    yield _span(left, smooth(left), frames, None, None)
                del frames  # pixels are not kept while later frames are decoded
            shot.clear()
            smoothed.clear()


def _span(
    left: Key,
    left_map: Future[Float32],
    frames: list[Placed[Analysed]],
    right: Key | None,
    right_map: Future[Float32] | None,
) -> Span:
    return Span(
        left.index,
        (left.picture, left_map),
        right.index if right else None,
        (right.picture, right_map) if right is not None and right_map is not None else None,
        tuple(item.analysed for item in frames),
        frozenset(item.analysed.index for item in frames if item.is_flash),
    )
