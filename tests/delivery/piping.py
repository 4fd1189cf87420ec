"""The command with a film through a pipe, and films to put through one."""

from __future__ import annotations

import subprocess
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import clips
import command

COUNT = 26


KINDS = {
    "h264.mkv": ("libx264", "yuv420p", None),
    "h264.ts": ("libx264", "yuv420p", "mpegts"),
    "ffv1.nut": ("ffv1", "yuv422p10le", None),
    "8.y4m": ("wrapped_avframe", "yuv420p", "yuv4mpegpipe"),
    "10.y4m": ("wrapped_avframe", "yuv420p10le", "yuv4mpegpipe"),
}


def piped(
    data: bytes | Path, *args: object, timeout: float = 90
) -> subprocess.CompletedProcess[bytes]:
    """The command with `data` (or a file's content) through a pipe on standard input."""
    content = data.read_bytes() if isinstance(data, Path) else data
    return subprocess.run(
        [*command.COMMAND, *map(str, args)], input=content, capture_output=True, timeout=timeout,
        env=command.ENVIRONMENT, check=False,
    )  # fmt: skip


def encoded(
    path: Path, codec: str, pixel_format: str, muxer: str | None = None, **tags: int
) -> Path:
    """The moving scene in a codec and container, B frames and all."""
    with av.open(str(path), "w", format=muxer, options={"strict": "-1"}) as box:
        stream: Any = box.add_stream(codec, rate=Fraction(24000, 1001))
        stream.width, stream.height, stream.pix_fmt = 96, 64, pixel_format
        stream.codec_context.thread_count = 1
        for name, value in tags.items():
            setattr(stream.codec_context, name, value)
        for i, codes in enumerate(clips.moving_scene(COUNT, cuts=(11,))):
            frame = av.VideoFrame.from_ndarray(codes, "rgb24").reformat(
                format=pixel_format, dst_colorspace="ITU709"
            )
            frame.pts = i
            for name, value in tags.items():
                setattr(frame, name, value)
            box.mux(stream.encode(frame))
        box.mux(stream.encode())
    return path
