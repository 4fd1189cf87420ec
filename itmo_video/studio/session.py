"""One clip, any frame, any settings: exactly what `convert` would write, with caches.

The pictures come from the renderer's own functions; intermediate results are cached.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Hashable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal, cast

import cv2
import numpy as np

from itmo_video.colour.linear_light import to_rgb_linear
from itmo_video.errors import DamagedInputError, ReplacedInputError
from itmo_video.expand_map.key_map import key_lights, make_key_map
from itmo_video.look import Look
from itmo_video.model import Code, Float32, Frame, Half
from itmo_video.motion.cut_detection import Analysed, analyse_frame
from itmo_video.motion.flow import flow_px
from itmo_video.motion.keyframes import Span
from itmo_video.rendering import spans
from itmo_video.rendering.frame import render
from itmo_video.rendering.map_settings import map_settings
from itmo_video.source.digest import SourceFiles
from itmo_video.source.opening import input_files, input_options, open_clip
from itmo_video.source.tags import InputOptions
from itmo_video.studio.memory import Memory, RememberedClip

Part = Literal["hdr", "sdr", "expand_map", "gain", "clip_mask"]
PARTS: tuple[Part, ...] = ("hdr", "sdr", "expand_map", "gain", "clip_mask")
SCALES = (1, 2, 4)

FRAME_BYTES = 400 << 20  # 130 frames of 1080p 4:2:0: a window and the frames played around it
MAP_BYTES = 200 << 20
_THREADS = 2
_NEAR = 64  # files of a sequence to either side that are looked at for a frame


class StaleError(Exception):
    """The picture is no longer needed."""


@dataclass(frozen=True)
class Shown:
    """A picture as stored in EXR: float16 (channels, H, W), linear, SDR white = 1."""

    index: int
    planes: Half
    primaries: str

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in pixels."""
        return self.planes.shape[2], self.planes.shape[1]


def _never() -> bool:
    return False


class Session:
    """An open clip with its caches; for one thread at a time. Close it, or use `with`."""

    def __init__(
        self,
        source: str | Path,
        options: InputOptions,
        frame_bytes: int = FRAME_BYTES,
        map_bytes: int = MAP_BYTES,
    ) -> None:
        """Open the clip; raises what `open_clip` does."""
        self._source, self._frame_bytes, self._map_bytes = Path(source), frame_bytes, map_bytes
        self._max_pixels = options.max_pixels
        self._pool = ThreadPoolExecutor(_THREADS, thread_name_prefix="studio-map")
        self._stale: Callable[[], bool] = _never
        self._files = input_files(source)
        self._as_opened = SourceFiles(self._files)
        self._open(options)

    def __enter__(self) -> Session:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    def close(self) -> None:
        """Release the clip and end the threads."""
        self._pool.shutdown(wait=True, cancel_futures=True)
        self.clip.close()

    @property
    def held_bytes(self) -> int:
        """The size of all cached pictures, without decoded frames."""
        return sum(m.held_bytes for m in (self._small, self._maps, self._seen, self._flows))

    def picture(
        self,
        index: int,
        look: Look,
        own: Look | None = None,
        part: Part = "hdr",
        scale: int = 1,
        stale: Callable[[], bool] = _never,
    ) -> Shown:
        """A frame as `convert` writes it: the clip with `look`, the frame with `own` (or `look`).

        With `scale` 2 or 4, codes are first averaged to 1/2 or 1/4 of the size; the map stays the
        same. Raises StaleError soon after `stale` returns true, DamagedInputError if the frame
        cannot be decoded, ReplacedInputError if the source is no longer what was opened.
        """
        self._stale = stale
        self.check_source(index)
        self._reopen(look)
        own = own or look
        frame, map_small, guide = self._frame_and_map(index, own)
        if scale > 1:
            frame = reduced(frame, scale)
        if part == "sdr":
            clip = own.settings.over_white == "clip"
            planes = to_rgb_linear(frame, clip=clip)
            return Shown(index, np.stack(planes).astype(np.float16), frame.encoding.primaries)
        layers = () if part == "hdr" else (part,)
        own = replace(own, settings=replace(own.settings, layers=layers))
        self._check()
        done = render(frame, map_small, own, guide)
        if part != "hdr":
            return Shown(index, done.layers[f"{part}.Y"][None], own.settings.primaries)
        return Shown(index, np.stack(done.rgb), own.settings.primaries)

    def check_source(self, index: int | None = None) -> None:
        """Raise ReplacedInputError if files, all or those near a frame, changed since opening.

        Frames are cached, so a change would otherwise be noticed late or only in part.
        """
        near = slice(None) if index is None else slice(max(0, index - _NEAR), index + _NEAR)
        for path in self._files[near] if len(self._files) > 1 else self._files:
            if (change := self._as_opened.change_of(path)) is not None:
                raise ReplacedInputError(
                    f"the file {change} since the studio opened it",
                    where=os.fspath(path),
                    remedy="Save what you decided, then restart the studio. (Moving the file "
                    "itself back helps, too; a copy does not count as the same file.)",
                )

    def frame(self, index: int) -> Frame:
        """The decoded frame at `index`; raises DamagedInputError if it cannot be decoded."""
        found = next(self.clip.frames(index), None)
        if found is None or found.index != index:
            raise DamagedInputError(
                f"frame {index} of the source cannot be decoded", where=str(self._source)
            )
        return found

    def lights(self, index: int, look: Look, own: Look | None = None) -> list[tuple[float, float]]:
        """The frame's median-cut lights, (x, y) from 0 to 1 across the picture."""
        self._stale = _never
        self.check_source(index)
        self._reopen(look)
        return key_lights(self.frame(index), (own or look).settings)

    def _open(self, options: InputOptions) -> None:
        self.clip = RememberedClip(open_clip(self._source, options), self._frame_bytes)
        self._options = options
        self._small = Memory[tuple[Float32, Code, Float32, Code]](self._map_bytes)
        self._maps = Memory[Float32](self._map_bytes)
        self._seen = Memory[Any](self._map_bytes)
        self._flows = Memory[tuple[Float32, Code, Code]](self._map_bytes)

    def _reopen(self, look: Look) -> None:
        """Read the clip with these settings; caches hold results of one reading only."""
        options = input_options(look.settings, self._max_pixels)
        if options != self._options:
            self.check_source()
            before = self.clip
            self._open(options)
            before.close()

    def _frame_and_map(
        self, index: int, look: Look
    ) -> tuple[Frame, Float32 | None, Float32 | None]:
        settings = look.settings
        if not look.needs_map:
            frame = self.frame(index)
            return frame, None, self._analyse(frame, settings.map_width).guide
        key = ("frame", index, map_settings(look))
        map_small = self._maps.get(key)
        if map_small is None:
            span, analysed = self._span_of(index, look)
            self._check()
            map_small = spans.map_between(span, analysed, look, self._make_map, self._find_flow)
            self._maps.put(key, map_small, map_small.nbytes)
            return analysed.frame, map_small, analysed.guide
        frame = self.frame(index)
        return frame, map_small, self._analyse(frame, settings.map_width).guide

    def _span_of(self, index: int, look: Look) -> tuple[Span, Analysed]:
        ended: list[Exception] = []
        (run,) = spans.plan_runs([index], look)
        found: Iterator[Span] = spans.spans_of(
            self.clip,
            run,
            look,
            ended.append,
            self._pool,
            self._analyse,
            self._make_map,
            self._find_flow,
        )
        for span in found:
            for analysed in span.frames:
                if analysed.index == index:
                    return span, analysed
        raise DamagedInputError(
            f"frame {index} of the source cannot be decoded", where=str(self._source)
        )

    def _analyse(self, frame: Frame, map_width: int) -> Analysed:
        self._check()

        def make() -> tuple[Float32, Code, Float32, Code]:
            made = analyse_frame(frame, map_width)
            return made.guide, made.grey, made.tiny, made.motion

        return Analysed(frame, *self._small.recall((frame.index, map_width), make, _bytes_of_all))

    def _make_map(self, frame: Frame, look: Look) -> Float32:
        key = ("key", frame.index, map_settings(look))
        reading = frame.index, look.operator.name, look.settings.map_width, look.settings.projection
        recall = partial(self._recall, reading)
        return self._maps.recall(key, lambda: make_key_map(frame, look, recall), _bytes_of)

    def _recall(self, reading: Hashable, what: str, make: Callable[[], Any]) -> Any:
        """An operator's result for a key's picture, cached: a new peak needs no network run."""
        return self._seen.recall((reading, what), make, _bytes_of)

    def _find_flow(self, here: Code, there: Code) -> Float32:
        # By identity, which is valid as long as both pictures are held with the flow.
        key = ("flow", id(here), id(there))
        return self._flows.recall(key, lambda: (flow_px(here, there), here, there), _bytes_of_all)[
            0
        ]

    def _check(self) -> None:
        if self._stale():
            raise StaleError


def _bytes_of(value: Any) -> int:
    return int(getattr(value, "nbytes", 1 << 10))


def _bytes_of_all(values: Sequence[Any]) -> int:
    return sum(_bytes_of(value) for value in values)


def reduced(frame: Frame, scale: int) -> Frame:
    """The frame with its codes averaged to 1 / `scale` of its size, keeping chroma subsampling."""
    width, height = frame.size
    if min(width, height) < 4 * scale:
        return frame
    small_w, small_h = -(-width // scale), -(-height // scale)

    def plane(codes: Code) -> Code:
        across, down = round(width / codes.shape[1]), round(height / codes.shape[0])
        size = (-(-small_w // across), -(-small_h // down))
        small = cv2.resize(codes, size, interpolation=cv2.INTER_AREA)
        return cast(Code, small.reshape(size[::-1]))

    planes: Sequence[Code] = [plane(codes) for codes in frame.planes]
    return replace(frame, planes=tuple(planes))
