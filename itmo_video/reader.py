"""The frame reader: probe a clip and decode it by frame number, in presentation order (PyAV)."""

from __future__ import annotations

import hashlib
import os
from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any, cast

import av
import numpy as np
from av.video.frame import VideoFrame
from av.video.stream import VideoStream

from itmo_video import tags
from itmo_video.errors import DamagedInputError, InputError
from itmo_video.model import ClipInfo, Code, Encoding, Frame
from itmo_video.tags import InputOptions

CONTAINERS = (
    "mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,avi,mpeg,mpegts,mpegvideo,mxf,ogg,flv,asf,gif,apng,"
    "ivf,h264,hevc,av1,obu,m4v,mjpeg,yuv4mpegpipe,nut,wtv,dv,rm,"
    "image2,png_pipe,jpeg_pipe,tiff_pipe,webp_pipe,bmp_pipe,image2pipe"
)
_DIGEST_BLOCK = 1 << 20
_DIGEST_WHOLE = 64 << 20


@dataclass(frozen=True)
class _Index:
    """Presentation time stamps of all frames, sorted, and those of the seek points."""

    pts: list[int]
    seek_pts: list[int]
    is_exact: bool  # false: stamps are missing or not unique, so frames are counted from the start


class Clip:
    """An open clip: `info` says what it is, `frames` decodes it; close it or use it in `with`."""

    def __init__(self, path: Path, options: InputOptions) -> None:
        self._path, self._options = path, options
        container = _open(path)
        try:
            stream = _video_stream(container, path)
            self._check_pixels(stream.codec_context.width, stream.codec_context.height)
            self._time_base = Fraction(stream.time_base or Fraction(1, 90000))
            self._index = _scan(container, stream)
            first = self._first_frame()
            self._encoding = tags.resolve_encoding(stream.codec_context, first, options, str(path))
            self._native = tags.native_format(first.format.name)
            self._size = (first.width, first.height)
            self._turn = tags.orientation(first)
            self.info = self._describe(container, stream)
        except av.FFmpegError as error:
            raise _unreadable(path, error) from error
        finally:
            container.close()

    def __enter__(self) -> Clip:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    def close(self) -> None:
        """Release the file; decoding opens it anew each time, so nothing is held in between."""

    def frames(self, start: int = 0) -> Iterator[Frame]:
        """Frames from index `start` on, in presentation order; the same whatever `start` is.

        Frames that do not decode are left out, so indices may have gaps. Raises
        DamagedInputError when a frame has another size or format than the first.
        """
        container = _open(self._path)
        try:
            stream = _video_stream(container, self._path)
            stream.thread_type = "AUTO"
            exact = self._index.is_exact
            if start > 0 and exact and start < len(self._index.pts):
                at = bisect_right(self._index.seek_pts, self._index.pts[start]) - 1
                if at > 0:
                    container.seek(self._index.seek_pts[at], stream=stream, backward=True)
            last = -1
            for decoded in _decode(container, stream):
                if exact and decoded.pts is not None:
                    index = bisect_left(self._index.pts, decoded.pts)
                    known = index < len(self._index.pts) and self._index.pts[index] == decoded.pts
                    if not known:
                        continue
                else:
                    index = last + 1
                if index <= last:
                    continue
                last = index
                if index >= start:
                    yield self._frame(index, decoded)
        finally:
            container.close()

    def _first_frame(self) -> VideoFrame:
        container = _open(self._path)
        try:
            stream = _video_stream(container, self._path)
            for frame in _decode(container, stream):
                self._check_pixels(frame.width, frame.height)
                return frame
        finally:
            container.close()
        raise InputError("no frame of it can be decoded", where=str(self._path))

    def _check_pixels(self, width: int, height: int) -> None:
        if width * height > self._options.max_pixels:
            raise InputError(
                f"{width}x{height} is more than {self._options.max_pixels} pixels a frame",
                where=str(self._path),
                remedy="Raise --max-pixels if that is meant.",
            )

    def _frame(self, index: int, decoded: VideoFrame) -> Frame:
        if (decoded.width, decoded.height) != self._size:
            raise DamagedInputError(
                f"frame {index} is {decoded.width}x{decoded.height}, "
                f"not {self._size[0]}x{self._size[1]} as before",
                where=str(self._path),
                remedy="What came before it was converted; split the file where its size changes.",
            )
        planes = tags.orient(_planes(decoded, self._native), self._turn, self._encoding)
        return Frame(index, self._time(index), planes, self._encoding, bool(decoded.is_corrupt))

    def _time(self, index: int) -> Fraction:
        if self._index.is_exact:
            return self._index.pts[index] * self._time_base
        return Fraction(index) / self.info.frame_rate

    def _describe(self, container: Any, stream: VideoStream) -> ClipInfo:
        pts, context = self._index.pts, stream.codec_context
        steps = np.diff(np.asarray(pts, np.int64)) if self._index.is_exact else np.zeros(0)
        # Matroska counts in whole milliseconds, so steps of a constant rate differ by one.
        is_vfr = bool(steps.size) and int(steps.max() - steps.min()) > 1
        rate = Fraction(stream.average_rate or stream.guessed_rate or 25)
        aspect = Fraction(context.sample_aspect_ratio or 1) or Fraction(1)
        rotation, flip = self._turn
        if rotation % 180:
            aspect = 1 / aspect
        frames = len(pts)
        return ClipInfo(
            path=str(self._path),
            stem=self._path.stem,
            container=str(container.format.name),
            codec=str(context.name),
            pixel_format=str(context.pix_fmt),
            width=self._size[0],
            height=self._size[1],
            frames=frames,
            frame_rate=rate,
            duration_s=frames / rate,
            is_vfr=is_vfr,
            pixel_aspect=aspect,
            rotation_deg=rotation,
            flip=flip,
            field_order=tags.field_order(context),
            timecode=tags.timecode(container, stream),
            encoding=self._encoding,
            digest=content_digest([self._path]),
            notices=tags.notices(context, self._encoding),
        )


def open_clip(path: str | Path, options: InputOptions | None = None) -> Clip:
    """Open a clip; raises InputError when it cannot be read and AlreadyHdrError when it is HDR."""
    options = options or InputOptions()
    absolute = Path(os.path.abspath(path))
    if not absolute.exists():
        raise InputError("no such file", where=str(path))
    if absolute.is_dir():
        raise InputError("is a folder, not a clip", where=str(path))
    if absolute.stat().st_size == 0:
        raise InputError("the file is empty", where=str(path))
    return Clip(absolute, options)


def content_digest(paths: list[Path]) -> str:
    """Digest of the files' content, not of their names: 32 hex digits.

    Whole files up to 64 MiB; of larger ones the size and 64 blocks of 1 MiB, evenly spread.
    """
    digest = hashlib.blake2b(digest_size=16)
    for path in paths:
        size = path.stat().st_size
        digest.update(size.to_bytes(8, "little"))
        with path.open("rb") as file:
            if size <= _DIGEST_WHOLE:
                digest.update(file.read())
                continue
            for i in range(64):
                file.seek(i * (size - _DIGEST_BLOCK) // 63)
                digest.update(file.read(_DIGEST_BLOCK))
    return digest.hexdigest()


def _open(path: Path) -> Any:
    try:
        # Only local files, only containers: a playlist could make FFmpeg read other files.
        options = {"protocol_whitelist": "file", "format_whitelist": CONTAINERS}
        return av.open(os.fspath(path), options=options, metadata_errors="replace")
    except (av.FFmpegError, ValueError, OSError) as error:
        raise _unreadable(path, error) from error


def _unreadable(path: Path, error: Exception) -> InputError:
    reason = getattr(error, "strerror", None) or str(error)
    return InputError(f"cannot be read: {reason}", where=str(path))


def _video_stream(container: Any, path: Path) -> VideoStream:
    videos = [s for s in container.streams.video if not _is_cover(s)]
    if not videos:
        raise InputError("there is no video in it", where=str(path))
    stream = videos[0]
    if stream.codec_context is None:
        raise InputError("its video codec is unknown", where=str(path))
    assert isinstance(stream, VideoStream)
    return stream


def _is_cover(stream: Any) -> bool:
    return "attached_pic" in str(getattr(stream, "disposition", ""))


def _scan(container: Any, stream: VideoStream) -> _Index:
    pts: list[int | None] = []
    seek: list[int] = []
    try:
        for packet in container.demux(stream):
            if packet.size == 0 or packet.is_discard:
                continue
            pts.append(packet.pts)
            if packet.is_keyframe and packet.pts is not None:
                seek.append(packet.pts)
    except av.FFmpegError:
        pass  # what was read until here is what there is
    known = [p for p in pts if p is not None]
    if len(known) == len(pts) and len(set(known)) == len(pts):
        return _Index(sorted(known), sorted(seek), True)
    return _Index(list(range(len(pts))), [], False)


def _decode(container: Any, stream: VideoStream) -> Iterator[VideoFrame]:
    """Decode on, past packets that fail."""
    packets = container.demux(stream)
    while True:
        try:
            packet = next(packets, None)
        except av.FFmpegError:
            return
        if packet is None:
            return
        try:
            decoded = packet.decode()
        except av.FFmpegError:
            continue
        for frame in decoded:
            if isinstance(frame, VideoFrame):
                yield frame


def _planes(frame: VideoFrame, native: tags.Native) -> tuple[Code, ...]:
    if frame.format.name != native.name:
        frame = frame.reformat(format=native.name)
    dtype = np.dtype(np.uint8) if native.bit_depth == 8 else np.dtype("<u2")
    arrays: list[Code] = []
    for i in native.order:
        plane = frame.planes[i]
        codes = np.frombuffer(memoryview(plane), dtype)
        rows = codes.reshape(plane.height, plane.line_size // dtype.itemsize)
        arrays.append(cast(Code, np.ascontiguousarray(rows[:, : plane.width])))
    return tuple(arrays)


def with_encoding(frame: Frame, encoding: Encoding) -> Frame:
    """The same codes read as another encoding."""
    return replace(frame, encoding=encoding)
