"""Choosing the video stream of a file, and its codec's tag."""

from __future__ import annotations

from typing import Any

from itmo_video.errors import InputError, UsageError

# FFmpeg's AV_DISPOSITION flags: an attached picture, timed thumbnails, a still image.
_DEFAULT, _NO_FILM = 1, 1 << 10 | 1 << 11 | 1 << 20


def choose_video(container: Any, wanted: int | None, where: str) -> tuple[Any, str | None]:
    """The video stream to read, and a notice if there was a choice.

    The one with the number `wanted`; otherwise the one flagged as default, or the first with more
    than one frame. Cover art is ignored. Raises UsageError for a number that is not a video stream,
    InputError if there is none, or none with a known codec.
    """
    videos = [s for s in container.streams if s.type == "video"]
    if wanted is not None:
        chosen = next((s for s in videos if s.index == wanted), None)
        if chosen is None:
            known = ", ".join(_named(s) for s in videos) or "none"
            raise UsageError(
                f"stream {wanted} is not a video stream",
                where=where,
                remedy=f"Video streams: {known}.",
            )
        if chosen.codec_context is None:
            raise InputError(f"the codec of stream {wanted} is not supported", where=where)
        return chosen, None
    films = [s for s in videos if not _has(s, _NO_FILM)]
    if not films:
        what = "contains no video, only cover art" if videos else "contains no video"
        raise InputError(what, where=where)
    usable = [s for s in films if s.codec_context is not None]
    if not usable:
        raise InputError("the video codec is not supported", where=where)
    flagged = [s for s in usable if _has(s, _DEFAULT)] or usable
    chosen = max(flagged, key=lambda s: (s.frames != 1, -s.index))
    if len(films) == 1:
        return chosen, None
    others = ", ".join(_named(s) for s in films if s is not chosen)
    return chosen, (
        f"{len(films)} video streams: reading {_named(chosen)}, not {others} "
        "(choose another with --stream N)"
    )


def codec_tag(context: Any) -> str:
    """The four characters by which a container names the codec; empty if they are not ASCII."""
    try:
        return str(context.codec_tag)
    except UnicodeDecodeError:  # PyAV on a damaged tag
        return ""


def _has(stream: Any, flags: int) -> bool:
    return bool(int(stream.disposition) & flags)


def _named(stream: Any) -> str:
    context = stream.codec_context
    size = "unknown codec" if context is None else f"{context.width}x{context.height}"
    return f"{stream.index} ({size}{', default' * _has(stream, _DEFAULT)})"
