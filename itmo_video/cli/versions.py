"""The output of `--version`: all versions that a bug report needs."""

from __future__ import annotations

import platform
import re
from importlib.metadata import PackageNotFoundError, requires, version

from itmo_video.kernels import library

_RIVALS = ("opencv-python", "opencv-python-headless", "opencv-contrib-python")
_MISSING = "is not installed"


def versions() -> list[str]:
    """Lines of names and versions; the first is `itmo-video VERSION`.

    Then Python, the required packages, the FFmpeg included in av, and whether the compiled kernels
    are used.
    """
    lines = [
        f"itmo-video {version('itmo_video')}",
        f"Python {platform.python_version()} on {platform.system()} {platform.machine()}",
    ]
    for requirement in requires("itmo_video") or ():
        if "extra ==" in requirement:
            continue
        name = re.split(r"[^\w.-]", requirement, maxsplit=1)[0]
        lines.append(f"{name} {_installed(name)}{_ffmpeg() if name == 'av' else ''}")
    # If several are installed, the last one has overwritten the files of the others.
    lines += [
        f"warning: {name} {_installed(name)} is also installed; pip uninstall it, then install"
        " opencv-contrib-python-headless again"
        for name in _RIVALS
        if _installed(name) != _MISSING
    ]
    return [*lines, f"compiled kernels: {library.state()}"]


def _installed(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return _MISSING


def _ffmpeg() -> str:
    try:
        import av
    except ImportError as error:
        return f", which cannot be loaded: {error}"
    return f" with FFmpeg {av.ffmpeg_version_info}"
