"""Opening a clip, still or image sequence as numbered frames of integer codes."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from pathlib import Path

from itmo_video.errors import DamagedInputError, InputError, UsageError
from itmo_video.model import Frame
from itmo_video.options import checked, checked_path
from itmo_video.regular_file import read_regular
from itmo_video.settings import Settings
from itmo_video.source import files
from itmo_video.source.animation import AnimationClip
from itmo_video.source.animation_times import timing
from itmo_video.source.clip import Clip as Clip
from itmo_video.source.clip import Resampled
from itmo_video.source.digest import SourceFiles
from itmo_video.source.still_reading import kind_of
from itmo_video.source.stills import StillClip, is_pattern, sequence
from itmo_video.source.tags import InputOptions
from itmo_video.source.video import VideoClip


def open_clip(path: str | Path, options: InputOptions | None = None) -> Clip:
    """Open a video file, a still image or a numbered sequence (`img.%04d.png`, `img.####.png`).

    With `options.fps` a clip is resampled to that rate; an image sequence is given it. Raises
    InputError if it cannot be read and AlreadyHdrError if it is already HDR.

    >>> from itmo_video import open_clip
    >>> with open_clip("clip.mkv") as clip:
    ...     clip.info.display_size, [frame.index for frame in clip.frames()]
    ((96, 64), [0, 1, 2])
    """
    options, path = checked(options, InputOptions, "options"), checked_path(path, "path")
    if options.raw is not None:
        raise UsageError(
            "--raw is for raw frames from a pipe, and this is a file",
            where=os.fspath(path),
            remedy="Pipe it in (itmo-video convert - OUTPUT_DIR --raw ... < FILE), or omit --raw.",
        )
    absolute = Path(os.path.abspath(path))
    clip: Clip
    if not os.path.lexists(absolute) and is_pattern(absolute):
        clip = StillClip(absolute, sequence(absolute), options)
    else:
        files.check_file(absolute)
        found = SourceFiles([absolute], files.PICTURE_BYTES)
        kind = kind_of(absolute)
        if kind is None:
            clip = VideoClip(absolute, options)
        elif (timed := timing(read_regular(absolute, files.PICTURE_BYTES), kind)) is not None:
            clip = AnimationClip(absolute, kind, timed, options, found)
        else:
            clip = StillClip(absolute, {0: absolute}, options)
    if options.fps is None or isinstance(clip, StillClip):  # images have no time stamps
        return clip
    return Resampled(clip, options.fps)


def input_files(path: str | Path) -> list[Path]:
    """The files that `open_clip` reads for `path`; empty if there is no such file."""
    absolute = Path(os.path.abspath(path))
    if os.path.lexists(absolute) or not is_pattern(absolute):
        return [absolute]
    try:
        return list(sequence(absolute).values())
    except InputError:
        return []


def is_film(path: Path) -> bool:
    """Whether `open_clip` reads `path` as a container, with time stamps and possibly sound."""
    is_file = os.path.lexists(path) or not is_pattern(path)
    if is_file:
        files.check_file(path)
    return is_file and kind_of(path) is None


def frames_at(clip: Clip, indices: Sequence[int]) -> Iterator[Frame]:
    """The frames at rising indices; raises DamagedInputError if one cannot be decoded."""
    frames = clip.frames(indices[0]) if indices else iter(())
    for index in indices:
        frame = next((found for found in frames if found.index >= index), None)
        if frame is None or frame.index != index:
            raise DamagedInputError(
                f"frame {index} of the source cannot be decoded", where=clip.info.path
            )
        yield frame


def input_options(settings: Settings, max_pixels: int) -> InputOptions:
    """The settings, and the user's limit, that determine how the source is read."""
    return InputOptions(
        transfer=settings.transfer,
        matrix=settings.matrix,
        range=settings.range,
        force_sdr=settings.force_sdr,
        deinterlace=settings.deinterlace,
        max_pixels=max_pixels,
        fps=settings.frame_rate,
        stream=settings.stream,
        raw=settings.raw,
    )
