"""Films for tests of the source, made in the test, and how they are compared."""

from __future__ import annotations

import itertools
import os
from collections.abc import Sequence
from pathlib import Path

import av
import cv2
import numpy as np
from clips import SHARED

from itmo_video.errors import DamagedInputError
from itmo_video.model import Code, Frame
from itmo_video.source.clip import Clip

DATA = SHARED / "data"
X264 = {"x264-params": "keyint=10:min-keyint=10:bframes=3:open-gop=1:scenecut=0"}
X265 = {"x265-params": "keyint=10:open-gop=1:bframes=3:log-level=none"}


def read(clip: Clip, start: int = 0, count: int | None = None) -> dict[int, Frame]:
    """Frames by index, up to the first refusal."""
    found = {}
    try:
        for frame in itertools.islice(clip.frames(start), count):
            found[frame.index] = frame
    except DamagedInputError:
        pass
    return found


def same(a: Frame, b: Frame) -> bool:
    """Whether two frames are the same in all that is said of them, and in every code."""
    return (
        a.index == b.index
        and a.time_s == b.time_s
        and a.encoding == b.encoding
        and len(a.planes) == len(b.planes)
        and all(np.array_equal(p, q) for p, q in zip(a.planes, b.planes, strict=True))
    )


def write_scene(
    path: Path,
    codec: str,
    count: int = 40,
    *,
    stored: str = "yuv420p",
    options: dict[str, str] | None = None,
    size: tuple[int, int] = (96, 64),
) -> Path:
    """A film of smooth noise that pans, 25 frames a second."""
    rng = np.random.default_rng(1)
    noise = cv2.GaussianBlur(rng.normal(0, 1, (size[1], size[0] + 3 * count, 3)), (0, 0), 3)
    scene = (255 / np.ptp(noise) * (noise - noise.min())).astype(np.uint8)
    with av.open(os.fspath(path), "w") as box:
        stream = box.add_stream(codec, rate=25, options=options or {})
        assert isinstance(stream, av.VideoStream)
        stream.width, stream.height = size
        stream.pix_fmt = stored
        if options and "g" in options:
            stream.codec_context.gop_size = int(options["g"])
        for n in range(count):
            picture = np.ascontiguousarray(scene[:, 3 * n : 3 * n + size[0]])
            frame = av.VideoFrame.from_ndarray(picture, "rgb24").reformat(format=stored, threads=1)
            frame.pts = n
            box.mux(stream.encode(frame))
        box.mux(stream.encode())
    return path


def write_planes(path: Path, stored: str, code_planes: Sequence[Code], **tags: int) -> Path:
    """A lossless clip of one frame with exactly these codes."""
    height, width = code_planes[0].shape
    return _write_raw(path, stored, code_planes, width, height, **tags)


def write_packed(path: Path, stored: str, codes: Code, width: int) -> Path:
    """A lossless clip of one frame whose only plane has these bytes."""
    return _write_raw(path, stored, [codes], width, len(codes))


def _write_raw(
    path: Path, stored: str, code_planes: Sequence[Code], width: int, height: int, **tags: int
) -> Path:
    with av.open(os.fspath(path), "w") as box:
        stream = box.add_stream("ffv1", rate=24)
        stream.width, stream.height, stream.pix_fmt = width, height, stored
        frame = av.VideoFrame(width, height, stored)
        for plane, codes in zip(frame.planes, code_planes, strict=True):
            raw = np.zeros((plane.height, plane.line_size), np.uint8)
            rows = np.ascontiguousarray(codes).view(np.uint8)
            raw[:, : rows.shape[1]] = rows
            plane.update(raw.tobytes())
        for name, value in tags.items():
            setattr(frame, name, value)
            setattr(stream.codec_context, name, value)
        frame.pts = 0
        box.mux(stream.encode(frame))
        box.mux(stream.encode())
    return path


def write_streams(path: Path, sizes: list[tuple[int, int]], default: int | None = None) -> Path:
    """A film of several video streams, one size each, 12 frames at 25 a second."""
    with av.open(str(path), "w") as box:
        streams = []
        for size in sizes:
            stream = box.add_stream("mpeg4", rate=25)
            stream.width, stream.height, stream.pix_fmt = *size, "yuv420p"
            streams.append(stream)
        for number, stream in enumerate(streams):
            if default is not None:
                stream.disposition = av.stream.Disposition(int(number == default))
        for n in range(12):
            for stream in streams:
                frame = av.VideoFrame(stream.width, stream.height, "yuv420p")
                for plane, value in zip(frame.planes, (40 + 10 * n, 128, 128), strict=True):
                    plane.update(bytes([value]) * plane.buffer_size)
                frame.pts = n
                box.mux(stream.encode(frame))
        for stream in streams:
            box.mux(stream.encode())
    return path
