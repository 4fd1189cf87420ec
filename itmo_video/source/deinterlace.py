"""Deinterlacing by FFmpeg's bwdif, one progressive frame for each interlaced one."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from fractions import Fraction
from typing import Any

import av

from itmo_video.memory_limit import check_memory
from itmo_video.source.decoding import Numbered

LEAD_IN = 4  # frames decoded before the first one wanted, so that it has neighbours


def can_deinterlace(frame: Any, is_forced: bool) -> bool:
    """Whether the filter accepts frames of this size and format."""
    if min(frame.width, frame.height) < 4:
        return False
    graph = _graph(frame, is_forced, Fraction(1))
    graph.vpush(frame)
    graph.vpush(None)
    # Formats that the filter does not support would be converted silently.
    return bool(graph.vpull().format.name == frame.format.name)


def deinterlaced(
    pictures: Iterator[Numbered],
    is_forced: bool,
    time_base: Fraction,
    is_same: Callable[[Any], bool],
) -> Iterator[Numbered]:
    """Yield each frame, deinterlaced from itself and its two neighbours, with its index.

    Progressive frames pass unchanged unless `is_forced`. A frame beyond a gap is no neighbour: it
    would depend on where reading begins. The first frame for which `is_same` is false is yielded
    unchanged, as the last one.
    """
    graph, waiting = None, deque[tuple[int, bool]]()
    last: int | None = None
    for index, decoded, is_damaged in pictures:
        if not is_same(decoded):
            yield index, decoded, is_damaged
            return
        if graph is not None and last is not None and index != last + 1:
            graph.vpush(None)
            yield from _pull(graph, waiting)
            graph = None
        last = index
        graph = graph or _graph(decoded, is_forced, time_base)
        waiting.append((index, is_damaged))
        decoded.pts, decoded.time_base = index, time_base
        graph.vpush(decoded)
        yield from _pull(graph, waiting)
    if graph is not None:
        graph.vpush(None)
        yield from _pull(graph, waiting)


def _graph(like: Any, is_forced: bool, time_base: Fraction) -> Any:
    graph = av.filter.Graph()
    source = graph.add_buffer(
        width=like.width, height=like.height, format=like.format, time_base=time_base
    )
    which = "all" if is_forced else "interlaced"
    bwdif = graph.add("bwdif", f"mode=send_frame:parity=auto:deint={which}")
    sink = graph.add("buffersink")
    source.link_to(bwdif)
    bwdif.link_to(sink)
    graph.configure()
    return graph


def _pull(graph: Any, waiting: deque[tuple[int, bool]]) -> Iterator[Numbered]:
    while True:
        try:
            picture = graph.vpull()
        except (av.FFmpegError, EOFError) as error:
            check_memory(error)
            return
        index, is_damaged = waiting.popleft()
        yield index, picture, is_damaged
