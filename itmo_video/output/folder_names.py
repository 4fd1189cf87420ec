"""Detecting names given for the output folder that mean something else."""

from __future__ import annotations

import os

from itmo_video.errors import UsageError
from itmo_video.regular_file import StrPath

FILM_SUFFIXES = (
    ".mp4", ".m4v", ".mov", ".mkv", ".webm", ".avi", ".mxf", ".ts", ".y4m", ".gif",
)  # fmt: skip
PICTURE_SUFFIXES = (
    ".exr", ".hdr", ".png", ".jpg", ".jpeg", ".tif", ".tiff", ".avif", ".heic", ".jxl", ".webp",
    ".dpx", ".bmp",
)  # fmt: skip


def check_folder_name(path: StrPath, source: StrPath = "INPUT") -> None:
    """Raise UsageError for the name of a film, a picture or a pipe, unless such a folder exists.

    A name that ends in a slash is always allowed. `source` is used in the remedy.
    """
    name, text = os.path.basename(path), os.fspath(path)
    suffix = os.path.splitext(name)[1].lower()
    if os.path.isdir(text) or text.endswith(("/", os.sep)):
        return
    if text == "-":
        raise UsageError(
            "EXR files are written to a folder, not to standard output",
            remedy=f"Give a folder; or encode a film: itmo-video preview {source} film.mp4",
        )
    if suffix in FILM_SUFFIXES:
        raise UsageError(
            f"{name} is the name of a film, but convert writes a folder of EXR files",
            remedy=f"Did you mean: itmo-video preview {source} {text}, "
            f"or the folder {os.path.splitext(text)[0]}/",
        )
    if suffix in PICTURE_SUFFIXES:
        preview = "" if suffix == ".exr" else f"itmo-video preview {source} {text} --frame 1, or "
        raise UsageError(
            f"{name} is the name of a picture, but convert writes a folder of numbered EXR files",
            remedy=f"Did you mean: {preview}the folder {os.path.splitext(text)[0]}/",
        )
