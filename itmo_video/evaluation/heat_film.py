"""Writes heat maps as a film: H.264 in MP4, which any player and browser shows."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from itmo_video.errors import OutputError, UsageError
from itmo_video.model import Code
from itmo_video.output.atomic import temp_path
from itmo_video.output.gate import Gate

_CRF = "18"


def check_film(path: Path) -> None:
    """Raise UsageError unless a heat map can be written under this name."""
    if path.suffix.lower() != ".mp4":
        raise UsageError(f"{path.name}: the heat map is a film", remedy="Name it .mp4.")


def write_film(gate: Gate, pictures: Iterator[Code], frame_rate: Fraction) -> int:
    """Write sRGB pictures, uint8 (H, W, 3), under a temporary name, rename; returns their number.

    If the size is odd, the last row or column is repeated. Raises OutputError if it cannot be
    written; the temporary file is then removed.
    """
    import av

    temp = temp_path(gate.path.absolute())
    count = 0
    try:
        with av.open(os.fspath(temp), "w", format="mp4") as box:
            stream: Any = None
            for count, picture in enumerate(pictures, 1):
                even = np.pad(picture, [(0, n % 2) for n in picture.shape[:2]] + [(0, 0)], "edge")
                if stream is None:
                    stream = _stream(box, even.shape, frame_rate)
                frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(even), "rgb24")
                frame = frame.reformat(
                    format="yuv420p", dst_colorspace="ITU709", dst_color_range="MPEG"
                )
                frame.pts = count - 1
                box.mux(stream.encode(frame))
            if stream is not None:
                box.mux(stream.encode(None))
        gate.put(temp)
    except (av.FFmpegError, OSError) as error:
        raise OutputError(f"cannot be written: {error}", where=str(gate.path)) from error
    finally:
        with suppress(OSError):
            temp.unlink()
    return count


def _stream(box: Any, shape: tuple[int, ...], frame_rate: Fraction) -> Any:
    stream = box.add_stream("libx264", rate=frame_rate, options={"crf": _CRF, "preset": "fast"})
    stream.height, stream.width = shape[:2]
    stream.pix_fmt = "yuv420p"
    context = stream.codec_context
    context.color_primaries, context.color_trc, context.colorspace = 1, 13, 1  # H.273: sRGB
    context.color_range = 1
    return stream
